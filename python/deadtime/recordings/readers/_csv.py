"""CSV files: one pass over all numbers at once.

`numpy.loadtxt` and, where it is loaded already or worth loading, `pyarrow.csv` read the columns
that are needed. Both are strict, and both round as Python does. Where they refuse the file, or what
they find cannot be a recording, the pass line by line reads it, or says which line is wrong.
"""

from __future__ import annotations

import io
import re
import sys
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import MissingExtraError
from deadtime._base.extras import library
from deadtime._base.validation import Range
from deadtime.recordings.readers._columns import Signals
from deadtime.recordings.readers._lines import read_lines
from deadtime.recordings.readers._text import Text, indices

#: Size of a text, bytes, from which pyarrow saves more time than it takes to load, 0.15 s.
LARGE = 16_000_000

#: Comments and empty lines.
_SKIPPED = re.compile(rb"^[ \t\r]*(?:#[^\n]*)?(?:\n|\Z)", re.MULTILINE)


def read_csv(text: Text, names: dict[str, str], ends: Range) -> Signals:
    """The columns of the signals within a window."""
    columns = indices(text, names)
    found = _at_once(text, sorted(set(columns.values())))
    if found is not None:
        signals = {signal: found[column] for signal, column in columns.items()}
        time = signals["time"]
        if np.isfinite(time).all() and (np.diff(time) > 0.0).all():
            if ends != (-np.inf, np.inf):
                rows = (time >= ends[0]) & (time <= ends[1])
                signals = {signal: column[rows] for signal, column in signals.items()}
            if all(np.isfinite(column).all() for column in signals.values()):
                return signals
    return read_lines(text, names, columns, ends)


def _at_once(text: Text, columns: list[int]) -> dict[int, NDArray[np.float64]] | None:
    """The columns as they stand in the file, or None where this cannot be told at once."""
    delimiter = text.delimiter
    if not delimiter.isascii() or delimiter in "\r\n.+-eE0123456789":
        return None
    if b"#" in text:
        text = replace(text, raw=_SKIPPED.sub(b"", text.body), start=0)
    if b'"' in text or (delimiter == " " and not text.raw.isascii()):
        return None
    if delimiter != "," and b"," in text:
        if b"." in text:
            return None  # which of the two is the decimal point is seen cell by cell
        text = replace(text, raw=text.body.replace(b",", b"."), start=0)
    if delimiter != " " and ("pyarrow" in sys.modules or len(text.raw) > LARGE):
        try:
            return _by_pyarrow(text, columns)
        except MissingExtraError:
            pass
    return _by_numpy(text.body, delimiter, len(text.header), columns)


def _by_pyarrow(text: Text, columns: list[int]) -> dict[int, NDArray[np.float64]] | None:
    pyarrow = library("pyarrow", "reading", "pyarrow")
    csv = library("pyarrow.csv", "reading", "pyarrow")
    names = [str(column) for column in range(len(text.header))]
    wanted = [names[column] for column in columns]
    try:
        table: Any = csv.read_csv(
            pyarrow.BufferReader(pyarrow.py_buffer(memoryview(text.raw)[text.start :])),
            read_options=csv.ReadOptions(column_names=names),
            parse_options=csv.ParseOptions(delimiter=text.delimiter, quote_char=False),
            convert_options=csv.ConvertOptions(
                check_utf8=False,
                include_columns=wanted,
                column_types=dict.fromkeys(wanted, pyarrow.float64()),
                null_values=[],
            ),
        )
    except pyarrow.ArrowException:
        return None
    return {int(name): table.column(name).to_numpy() for name in wanted}


def _by_numpy(
    body: bytes, delimiter: str, width: int, columns: list[int]
) -> dict[int, NDArray[np.float64]] | None:
    blank = delimiter == " "
    if not body:
        return None
    if not blank and not _is_rectangular(body, delimiter, width):
        body = _SKIPPED.sub(b"", body)  # loadtxt skips empty lines, and they are not counted
        if not body or not _is_rectangular(body, delimiter, width):
            return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # no rows
            table = np.loadtxt(
                io.BytesIO(body),
                comments=None,
                delimiter=None if blank else delimiter,
                usecols=None if blank else columns,
                encoding="latin-1",
                ndmin=2,
            )
    except (ValueError, IndexError, UserWarning):
        return None
    if blank:
        # All columns are read: a line with more cells than another one is refused.
        if table.shape[1] != width:
            return None
        table = table[:, columns]
    return dict(zip(columns, table.T, strict=True))


def _is_rectangular(body: bytes, delimiter: str, width: int) -> bool:
    """Whether every line has as many cells as the header: loadtxt checks the least number only."""
    text = np.frombuffer(body, dtype=np.uint8)
    ends = text[np.flatnonzero((text == ord(delimiter)) | (text == ord("\n")))]
    if text[-1] != ord("\n"):
        ends = np.append(ends, np.uint8(ord("\n")))
    if ends.size % width:
        return False
    ends = ends.reshape(-1, width)
    return bool((ends[:, -1] == ord("\n")).all() and (ends[:, :-1] != ord("\n")).all())
