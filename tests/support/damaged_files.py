"""Damaged files for the readers: each is read, or refused by an error of the package.

    python tests/support/damaged_files.py DataFlash --count 1000000 --seed 1

Files of at most 4 kB, bags of at most 32, are changed at random and read in this process. It
prints, as JSON, how many were read and refused, the longest time for one, and by how much the
memory grew. Any other exception, a file that takes more than `LIMIT` seconds, and a crash end it
with an error; the file is left in the folder that is printed then.
"""

from __future__ import annotations

import argparse
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
from mutations import LARGEST, mutated
from small_bags import LARGEST as LARGEST_BAG, SMALL_BAGS, read_bag
from small_logs import SMALL
from small_tables import FORMATS, WORDS

#: Longest time for one file, s.
LIMIT = 10.0


class TooLongError(BaseException):
    """No `Exception`, which a reader takes for a damage of the file."""


def read_table(path: Path) -> None:
    dtm.read_recording(path)


def load_table(path: Path) -> None:
    dtm.Recording.load(path)


def open_log(path: Path) -> None:
    dtm.open_log(path)


def show_log(path: Path) -> None:
    log = dtm.open_log(path)
    assert all(line.isprintable() for line in log.summary().split("\n"))
    assert log.to_dict()
    for loop in log.loops.values():
        assert np.all(np.diff(loop.setpoint.time) > 0.0)
        assert loop.summary()


def peak() -> int:
    """Largest memory of this process so far, bytes."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def too_long(*_) -> None:
    raise TooLongError(f"a file took more than {LIMIT} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("format", choices=[*FORMATS, *SMALL, *SMALL_BAGS])
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    largest, ending = LARGEST, ""
    if options.format in SMALL_BAGS:
        ending, made = SMALL_BAGS[options.format]
        largest, contents, words, readers = LARGEST_BAG, [made()], WORDS[:4], [read_bag]
    elif options.format in FORMATS:
        contents, words, readers = FORMATS[options.format](), WORDS, [read_table] * 9 + [load_table]
    else:
        contents, words, readers = (
            [SMALL[options.format][1]()],
            WORDS[:4],
            [open_log] * 9 + [show_log],
        )
    folder = Path(tempfile.mkdtemp(prefix="damaged-"))
    path = folder / f"file{ending}"
    counts = {"read": 0, "refused": 0, "slowest": 0.0}
    for content in contents:
        assert len(content) <= largest, len(content)
        path.write_bytes(content)
        readers[0](path)
    signal.signal(signal.SIGALRM, too_long)
    before = peak()
    for _ in range(options.count):
        path.write_bytes(mutated(draw.choice(contents), draw, words, largest))
        read = draw.choice(readers)
        signal.setitimer(signal.ITIMER_REAL, LIMIT)
        start = time.perf_counter()
        try:
            read(path)
            counts["read"] += 1
        except (dtm.RecordingError, dtm.MissingExtraError) as error:
            if not str(error).isprintable():
                raise ValueError(f"the error is no line of text: {error}") from error
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
