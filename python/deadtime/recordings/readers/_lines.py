"""CSV files line by line: what is wrong, and in which line."""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from collections.abc import Iterator

import numpy as np

from deadtime._base.errors import RecordingError
from deadtime._base.validation import Range
from deadtime.recordings.readers._columns import Signals, time_error
from deadtime.recordings.readers._text import Text

DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


def read_lines(text: Text, names: dict[str, str], columns: dict[str, int], ends: Range) -> Signals:
    """The columns of the signals within a window; rows outside it need only a time."""
    low, high = ends
    found = {signal: array("d") for signal in names}
    cell_value = _Values(text)
    last = None
    for number, cells in _rows(text):
        _check_width(text, number, cells)
        now = cell_value(number, cells, columns["time"])
        if last is not None and now <= last:
            raise time_error(f"{text.path}, line {number}", last, now)
        last = now
        if not low <= now <= high:
            continue  # setpoints are often NaN there
        found["time"].append(now)
        for signal, column in columns.items():
            if signal != "time":
                found[signal].append(cell_value(number, cells, column))
    return {signal: np.array(values) for signal, values in found.items()}


def _rows(text: Text) -> Iterator[tuple[int, list[str]]]:
    """The cells of each line with its number, without comments and empty lines."""
    number = text.line - 1
    lines = io.TextIOWrapper(io.BytesIO(text.body), text.encoding)

    def kept() -> Iterator[str]:
        nonlocal number
        for line in lines:
            number += 1
            if line.strip() and not line.lstrip().startswith("#"):
                yield " ".join(line.split()) if text.delimiter == " " else line

    try:
        for cells in csv.reader(kept(), delimiter=text.delimiter, strict=True):
            yield number, cells
    except csv.Error as error:
        raise RecordingError(f"{text.path} is not a CSV file: line {number}: {error}") from None


def _check_width(text: Text, number: int, cells: list[str]) -> None:
    width = len(text.header)
    if any(cell.strip() for cell in cells[width:]):
        raise RecordingError(
            f"{text.path}, line {number}: {len(cells)} cells under {width} column names; if commas "
            "stand for decimal points, write points, or separate the columns by semicolons"
        )


class _Values:
    """Numbers of cells. Commas stand for decimal points in all cells or in none."""

    def __init__(self, text: Text) -> None:
        self.text = text
        self.first_with: dict[str, int] = {}  # lines of the first decimal comma and point

    def __call__(self, number: int, cells: list[str], column: int) -> float:
        where, name = f"{self.text.path}, line {number}", self.text.header[column]
        if column >= len(cells):
            raise RecordingError(f"{where}: {len(cells)} cells, so the column {name!r} has none")
        cell = cells[column]
        what = f"{where}: {cell!r} in column {name!r}"
        mark = "," if "," in cell else "." if "." in cell else ""
        if mark:
            self._check_mark(what, number, mark, cell)
        try:
            if "_" in cell:  # float() would read 1_000 as 1000
                raise ValueError
            value = float(cell.replace(",", "."))
        except ValueError:
            raise RecordingError(f"{what} is not a number") from None
        if not math.isfinite(value):
            raise RecordingError(
                f"{where}: {name!r} is {value}; leave the row out, or read a window without it"
            )
        return value

    def _check_mark(self, what: str, number: int, mark: str, cell: str) -> None:
        if mark == "," and not DECIMAL_COMMA.fullmatch(cell.strip()):
            raise RecordingError(f"{what} is not a number: write a decimal point and no comma")
        self.first_with.setdefault(mark, number)
        if len(self.first_with) > 1:
            other = "." if mark == "," else ","
            raise RecordingError(
                f"{what} has a decimal {'comma' if mark == ',' else 'point'}, and line "
                f"{self.first_with[other]} has the other: write a decimal point in all cells"
            )
