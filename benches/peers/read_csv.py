"""A recording from a CSV file beside pandas, polars and numpy: alternated in one process.

Four columns, 300 000 rows: a log as controllers print it (six decimals) and one with all digits of
its doubles. Ours finds the columns, checks times and values and makes a `Recording`; the peers make
a table. The limits beside them are reading the bytes, and one pass over them that counts
separators.
Run ``python benches/peers/read_csv.py [--quick]``.
"""

from __future__ import annotations

import argparse
import importlib
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np

Call = Callable[[], Any]


def optional(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"{name} is not installed: pip install {name}")
        return None


def write(path: Path, rows: int, digits: int | None) -> None:
    draw = np.random.default_rng(1)
    stamps = np.arange(rows) * 1e-3
    table = [
        stamps,
        np.where(np.sin(stamps) > 0.0, 1.0, 0.0),
        np.cumsum(draw.normal(size=rows)) * 1e-3,
        draw.normal(size=rows),
    ]
    columns = [column if digits is None else np.round(column, digits) for column in table]
    with path.open("w") as stream:
        stream.write("time,reference,output,command\n")
        for row in zip(*(map(repr, column.tolist()) for column in columns), strict=True):
            stream.write(",".join(row) + "\n")


def calls(path: Path) -> dict[str, Call]:
    """What is measured, by its name."""
    found: dict[str, Call] = {"ours": lambda: dtm.read_recording(path, command="command")}
    if pandas := optional("pandas"):
        found["pandas.read_csv"] = lambda: pandas.read_csv(path)
    if polars := optional("polars"):
        found["polars.read_csv"] = lambda: polars.read_csv(path)
    found["numpy.loadtxt"] = lambda: np.loadtxt(path, delimiter=",", skiprows=1)
    found["numpy.genfromtxt"] = lambda: np.genfromtxt(path, delimiter=",", names=True)
    found["the bytes alone"] = path.read_bytes
    found["one pass over them"] = lambda: path.read_bytes().count(b",")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="20 000 rows, rough numbers")
    quick = parser.parse_args().quick
    rows, rounds = (20_000, 3) if quick else (300_000, 9)
    with tempfile.TemporaryDirectory() as folder:
        for name, digits in (("six decimals", 6), ("all digits", None)):
            path = Path(folder) / "log.csv"
            write(path, rows, digits)
            measured = calls(path)
            times: dict[str, list[float]] = {one: [] for one in measured}
            for _ in range(rounds):
                for one, call in measured.items():
                    start = time.perf_counter()
                    call()
                    times[one].append(time.perf_counter() - start)
            size = path.stat().st_size
            print(f"{rows} rows, {name}, {size / 1e6:.1f} MB")
            base = statistics.median(times["ours"])
            print(f"{'':26s}{'ms':>9s}{'MB/s':>9s}{'ratio to ours':>16s}")
            for one, values in times.items():
                middle = statistics.median(values)
                print(
                    f"{one:26s}{1e3 * middle:9.1f}{size / middle / 1e6:9.0f}{middle / base:16.2f}"
                )


if __name__ == "__main__":
    main()
