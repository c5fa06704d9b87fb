"""Missing values of a recording: a value that was not logged is a row that is missing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.errors import RecordingError

#: Columns that hold their value until it changes.
HELD = ("reference", "command")


def with_rows_missing(columns: dict[str, ArrayLike]) -> dict[str, ArrayLike]:
    """The columns with NaN for outputs that are missing, and held values filled in.

    Missing is what is masked or NaN. A row without a time is left out.
    """
    if len({np.shape(values) for values in columns.values()}) > 1:
        return columns  # refused by the caller, with the lengths
    missing = {name: _missing(values) for name, values in columns.items()}
    if not any(mask.any() for mask in missing.values()) or missing["output"].ndim != 1:
        return columns
    found: dict[str, Any] = {name: np.ma.getdata(values) for name, values in columns.items()}
    without_time = (
        missing["time"] if _is_masked(columns["time"]) else np.zeros_like(missing["time"])
    )
    for name in HELD:
        if name in columns:
            found[name] = _filled(name, found[name], missing[name])
            _refuse_changes(name, found[name], without_time, "has no time")
    if missing["output"].any():
        found["output"] = np.where(missing["output"], np.nan, found["output"])
    return {name: values[~without_time] for name, values in found.items()}


def rows_with_output(
    output: NDArray[np.float64], held: dict[str, NDArray[np.float64]]
) -> NDArray[np.bool_] | None:
    """The rows that have an output; None where all have.

    Refused where a held column changes in a row that has none: a method that knows kept rows alone
    would see the change later than it was.
    """
    missing = np.isnan(output)
    if not missing.any():
        return None
    for name, values in held.items():
        _refuse_changes(name, values, missing, "is missing")
    return ~missing


def _is_masked(values: ArrayLike) -> bool:
    return isinstance(values, np.ma.MaskedArray)


def _missing(values: ArrayLike) -> NDArray[np.bool_]:
    """Which values are masked or NaN."""
    data: NDArray[Any] = np.ma.getdata(values)
    found: NDArray[np.bool_] = np.array(np.ma.getmaskarray(np.ma.asarray(values)))
    return found | np.isnan(data) if data.dtype.kind == "f" else found


def _filled(name: str, values: NDArray[Any], missing: NDArray[np.bool_]) -> NDArray[Any]:
    """A held column with the value of the row before where it is missing, of the first known first.

    Refused where the rows before and after differ: the time of the change is unknown.
    """
    known = np.flatnonzero(~missing)
    if known.size in (0, missing.size):
        return values
    rows = np.flatnonzero(missing)
    place = np.searchsorted(known, rows)
    before = known[np.maximum(place - 1, 0)]
    after = known[np.minimum(place, known.size - 1)]
    inside = (place > 0) & (place < known.size)
    _refuse(name, rows[inside & (values[before] != values[after])], "is missing")
    filled = values.copy()
    filled[rows] = values[before]
    return filled


def _refuse_changes(name: str, values: NDArray[Any], gone: NDArray[np.bool_], what: str) -> None:
    """Refuse rows that go where a held column changes in them and a kept row follows."""
    kept = np.flatnonzero(~gone)
    rows = np.flatnonzero(gone)
    place = np.searchsorted(kept, rows)
    inside = (place > 0) & (place < kept.size)
    rows, before = rows[inside], kept[place[inside] - 1]
    _refuse(name, rows[values[rows] != values[before]], what)


def _refuse(name: str, rows: NDArray[np.intp], what: str) -> None:
    if rows.size:
        raise RecordingError(
            f"row {rows[0]} {what}, and the {name} changes in this gap at an unknown time. Fill "
            "in the missing values, or choose a window without missing values"
        )
