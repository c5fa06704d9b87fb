"""Small tables in every format that is read, of at most 4 kB each: a corpus to damage."""

from __future__ import annotations

import gzip
import io
import tempfile
from pathlib import Path

import deadtime as dtm
import numpy as np

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
    "parquet": parquets,
    "arrow": arrows,
    "mat": mats,
    "mat73": mat73s,
}
