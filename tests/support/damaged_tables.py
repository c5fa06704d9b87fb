"""Damaged files for the readers of tables: each is read, or refused by an error of the package.

    python tests/support/damaged_tables.py text --count 1000000 --seed 1

Files of at most 4 kB are changed at random and read in this process. It prints, as JSON, how many
were read and refused, the longest time for one, and by how much the memory grew. Any other
exception, a file that takes more than `LIMIT` seconds, and a crash end it with an error; the file
is left in the folder that is printed then.
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
import random
import resource
import signal
import sys
import tempfile
import time
from pathlib import Path

import deadtime as dtm
import numpy as np

#: Longest time for one file, s.
LIMIT = 10.0

TIME = np.arange(24) * 0.1
COLUMNS = {
    "time": TIME,
    "reference": np.where(TIME < 0.95, 0.0, 1.0),
    "output": np.round(np.sin(TIME) / 3.0, 6),
}

#: What stands in damaged text, besides any bytes.
WORDS = (
    b"nan", b"-inf", b"1e999", b"1_0", b"0x1p3", b'"', b'""', b"#", b"\n", b"\r", b"\r\n", b",",
    b";", b"\t", b" ", b".", b",,,,", b"-", b"\0", b"\xef\xbb\xbf", b"\xff\xfe", b"\xb0",
    b"9" * 400, b"1e-400", b"time", b"output", b"\x1f\x8b\x08", b"{", b"\xd9\xa1",
)  # fmt: skip


def texts():
    """Tables in text, in every writing that is read."""
    rows = [
        ",".join(COLUMNS),
        *(",".join(map(str, row)) for row in zip(*COLUMNS.values(), strict=True)),
    ]
    plain = "\n".join(rows) + "\n"
    commas = plain.replace(",", ";").replace(".", ",")
    with tempfile.TemporaryDirectory() as folder:
        dtm.Recording(*COLUMNS.values(), units={"output": "m"}).save(f"{folder}/run.csv")
        saved = Path(folder, "run.csv").read_bytes()
    quoted = "\n".join(",".join(f'"{cell}"' for cell in row.split(",")) for row in rows)
    return [
        plain.encode(),
        plain.replace(",", "\t").replace("\n", "\r\n").encode("utf-8-sig"),
        ("# a flight\n" + plain.replace(",", "  ")).encode(),
        commas.encode(),
        quoted.encode(),
        commas.encode("utf-16"),
        gzip.compress(plain.encode(), 1),
        saved,
    ]


def parquets():
    import pyarrow
    from pyarrow import parquet

    def written(**options):
        stream = io.BytesIO()
        parquet.write_table(pyarrow.table(COLUMNS), stream, **options)
        return stream.getvalue()

    return [
        written(),
        written(compression="zstd", use_dictionary=False),
        written(compression="gzip", data_page_version="2.0"),
        written(compression="none", use_byte_stream_split=True, use_dictionary=False),
    ]


def arrows():
    import pyarrow

    table = pyarrow.table(COLUMNS)
    found = []
    for new in (pyarrow.ipc.new_file, pyarrow.ipc.new_stream):
        for packing in (None, "zstd", "lz4"):
            stream = io.BytesIO()
            options = pyarrow.ipc.IpcWriteOptions(compression=packing)
            with new(stream, table.schema, options=options) as out:
                out.write_table(table)
            found.append(stream.getvalue())
    return found


def mats():
    from scipy.io import savemat

    found = []
    for packed in (False, True):
        stream = io.BytesIO()
        log = {"time": TIME, "signals": {"values": np.stack([*COLUMNS.values()], axis=1)}}
        savemat(stream, COLUMNS | {"log": log}, do_compression=packed)
        found.append(stream.getvalue())
    return found


def mat73s():
    import h5py

    found = []
    for packing, version in ((None, None), (None, "latest"), ("gzip", "latest")):
        stream = io.BytesIO()
        with h5py.File(stream, "w", userblock_size=512, libver=version) as file:
            for name, values in COLUMNS.items():
                file.create_dataset(name, data=values[:, None].T, compression=packing)
        content = bytearray(stream.getvalue())
        content[:128] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
        found.append(bytes(content))
    return found


FORMATS = {
    "text": texts,
    "text-pyarrow": texts,
    "parquet": parquets,
    "arrow": arrows,
    "mat": mats,
    "mat73": mat73s,
}


def damaged(content: bytes, draw: random.Random) -> bytes:
    """The content after one to six changes at random places; its first bytes are mostly kept."""
    changed = bytearray(content)
    for _ in range(draw.choice((1, 1, 2, 3, 6))):
        at = draw.randrange(0 if draw.random() < 0.1 else min(8, len(changed)), len(changed) + 1)
        length = min(draw.choice((1, 1, 2, 4, 8, 30)), max(0, len(changed) - at))
        kind = draw.randrange(8)
        if kind == 0 and at < len(changed):
            changed[at] ^= 1 << draw.randrange(8)
        elif kind == 1:
            changed[at : at + length] = draw.randbytes(length)
        elif kind == 2:
            del changed[at : at + length]
        elif kind == 3:
            changed[at:at] = changed[at : at + length]
        elif kind == 4:
            changed[at : at + draw.choice((0, length))] = draw.choice(WORDS)
        elif kind == 5:
            number = draw.choice((0, 1, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1))
            changed[at : at + 4] = number.to_bytes(4, draw.choice(("little", "big")))
        elif kind == 6:
            del changed[at:]
        else:
            other = draw.randrange(len(changed) + 1)
            changed[at : at + length] = changed[other : other + length]
        if not changed:
            break
    return bytes(changed[:4096])


def peak() -> int:
    """Largest memory of this process so far, bytes."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def too_long(*_) -> None:
    raise SystemExit(f"a file took more than {LIMIT} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("format", choices=FORMATS)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    if options.format == "text":
        sys.modules["pyarrow"] = None
    elif options.format == "text-pyarrow":
        import pyarrow.csv  # noqa: F401
    contents = FORMATS[options.format]()
    folder = Path(tempfile.mkdtemp(prefix="damaged-"))
    path = folder / "table"
    counts = {"read": 0, "refused": 0, "slowest": 0.0}
    for content in contents:
        assert len(content) <= 4096, len(content)
        path.write_bytes(content)
        assert len(dtm.read_recording(path)) == TIME.size
    signal.signal(signal.SIGALRM, too_long)
    before = peak()
    for _ in range(options.count):
        path.write_bytes(damaged(draw.choice(contents), draw))
        signal.setitimer(signal.ITIMER_REAL, LIMIT)
        start = time.perf_counter()
        try:
            (dtm.Recording.load if draw.random() < 0.1 else dtm.read_recording)(path)
            counts["read"] += 1
        except (dtm.RecordingError, dtm.MissingExtraError) as error:
            if len(str(error).splitlines()) != 1:
                raise ValueError(f"the error has several lines: {error}") from error
            counts["refused"] += 1
        except BaseException:
            print(f"the file is {path}", file=sys.stderr)
            raise
        counts["slowest"] = max(counts["slowest"], time.perf_counter() - start)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    path.unlink()
    folder.rmdir()
    print(json.dumps(counts | {"grown": peak() - before}))


if __name__ == "__main__":
    main()
