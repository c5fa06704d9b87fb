"""Columns of a table by their names, as numbers, within a window."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import RecordingError
from deadtime._base.validation import Range
from deadtime.recordings.readers._repeated import spread, time_error

#: Columns by their signals: "time", "reference", "output" and, if it is there, "command".
Signals = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Table:
    """Columns that are taken when they are asked for.

    Attributes
    ----------
    label : str
        What messages call the table.
    names : sequence of str
        Names of its columns.
    take : callable
        From a name to the values of its column.
    """

    label: str
    names: Sequence[str]
    take: Callable[[str], Any]


def column_index(label: object, names: Sequence[str], signal: str, name: str) -> int:
    """Index of the column for a signal, by its name."""
    count = names.count(name)
    if count == 1:
        return names.index(name)
    if count > 1:
        raise RecordingError(
            f"{label} has {count} columns with the name {name!r}: give each column another name"
        )
    similar = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean {similar[0]!r}?" if similar else ""
    shown = ", ".join(repr(header) for header in names[:12]) + (", …" if len(names) > 12 else "")
    raise RecordingError(
        f"{label} has no column {name!r} for the {signal}. Its columns are {shown}{hint}"
    )


def read_table(table: Table, names: Mapping[str, str], ends: Range) -> Signals:
    """The columns of the signals within a window, missing values masked.

    Time stamps must increase in the whole table. Outside the window values need not be valid.
    """
    for signal, name in names.items():
        column_index(table.label, table.names, signal, name)
    columns = {
        signal: numbers(f"{table.label}: the column {name!r}", table.take(name))
        for signal, name in names.items()
    }
    lengths = {names[signal]: column.size for signal, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise RecordingError(f"the columns of {table.label} have different lengths: {lengths}")
    rows, columns["time"] = _rows(table.label, names["time"], columns["time"], ends)
    columns = {signal: column[rows] for signal, column in columns.items()}
    for signal, column in columns.items():
        bad = np.flatnonzero(np.isinf(np.ma.getdata(column)) & ~np.ma.getmaskarray(column))
        if bad.size:
            raise RecordingError(
                f"{table.label}, row {rows.start + bad[0]}: {names[signal]!r} is "
                f"{column[bad[0]]}. Leave this row out, or choose a window without this row"
            )
    return columns


def _rows(
    label: str, name: str, time: NDArray[np.float64], ends: Range
) -> tuple[slice, NDArray[np.float64]]:
    """Rows from the first time in the window to the last one, and all times."""
    known = np.flatnonzero(~np.ma.getmaskarray(time))
    stamps = np.ma.getdata(time)[known]
    bad = np.flatnonzero(~np.isfinite(stamps))
    if bad.size:
        raise RecordingError(
            f"{label}, row {known[bad[0]]}: {name!r} is {stamps[bad[0]]}. Leave this row out"
        )
    for wrong in (np.diff(stamps) < 0.0, np.diff(stamps) == 0.0):
        place = int(np.argmax(wrong)) if wrong.any() else None
        if place is None:
            continue
        before, now = stamps[place : place + 2].tolist()
        where = f"{label}, row {known[place + 1]}"
        if now < before:
            raise time_error(where, before, now)
        stamps = spread(stamps, where, now)
        time = time.copy()
        time[known] = stamps
    inside = known[(stamps >= ends[0]) & (stamps <= ends[1])]
    rows = slice(int(inside[0]), int(inside[-1]) + 1) if inside.size else slice(0, 0)
    return rows, time


def numbers(label: str, values: Any) -> NDArray[np.float64]:
    """The values as a column of doubles, a masked array where some are missing.

    Durations become seconds, dates the seconds after the first of them.
    """
    if isinstance(values, np.ma.MaskedArray):
        return np.ma.array(numbers(label, values.data), mask=np.ma.getmaskarray(values))
    try:
        array = np.asarray(values)
        if array.dtype.kind == "M":
            array = array - array[~np.isnat(array)][:1]
        if array.dtype.kind == "m":
            array = array / np.timedelta64(1, "s")
        if array.dtype.kind not in "biufO" or any(isinstance(value, str) for value in _some(array)):
            kind = "complex numbers" if array.dtype.kind == "c" else f"{array.dtype} values"
            raise TypeError(f"it contains {'text' if array.dtype.kind in 'OUST' else kind}")
        column = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise RecordingError(f"{label} is not a column of numbers: {error}") from None
    if column.ndim != 1:
        raise RecordingError(f"{label} has shape {column.shape}: give a one-dimensional array")
    return column


def _some(array: NDArray[Any]) -> list[Any]:
    """The objects of an array of objects."""
    return array.ravel().tolist() if array.dtype == object else []


def widened(low: float, high: float) -> Range:
    """The ends of a window, widened by rounding of the last printed digit."""
    start = low if math.isinf(low) else low - 1e-9 * max(1.0, abs(low))
    stop = high if math.isinf(high) else high + 1e-9 * max(1.0, abs(high))
    return start, stop
