"""The windows of a loop in which its setpoint is really followed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deadtime.logs._contents import LogContents
from deadtime.logs._names import Condition, Windows
from deadtime.logs._series import Series
from deadtime.logs._windows import held_rows, length, outside, runs, shared

#: Fewest rows of setpoint and response in a segment.
FEWEST = 8

#: Fewest different values, and least time, s, of a setpoint that is a copy of the response.
COPIED = 5
COPY_LASTS = 0.5


def segments_of(
    contents: LogContents,
    setpoint: Series,
    response: Series,
    conditions: Sequence[Condition],
    start: float,
) -> tuple[tuple[tuple[float, float], ...], tuple[str, ...]]:
    """The windows, s from `start`, and a sentence for each reason to leave some time out."""
    first = max(setpoint.time[0], response.time[0])
    last = min(setpoint.time[-1], response.time[-1])
    kept: Windows = [(float(first), float(last))] if first < last else []
    reasons: list[str] = []
    if not kept:
        reasons.append("setpoint and response were never logged at the same time")
    for condition in conditions:
        found = condition.windows(contents)
        if found is not None:
            moved = [(low - start, high - start) for low, high in found]
            kept = _cut(kept, moved, condition.otherwise, reasons)
    for name, series in (("setpoint", setpoint), ("response", response)):
        finite = held_rows(series.time, np.isfinite(series.values))
        kept = _cut(kept, finite, f"the {name} is not a number (NaN)", reasons)
        kept = _cut(kept, outside(list(series.gaps)), f"the {name} has a gap", reasons)
    lost = [(low - start, high - start) for low, high in contents.gaps]
    kept = _cut(kept, outside(lost), "the logger lost data", reasons)
    copies = outside(_copies(setpoint, response))
    kept = _cut(kept, copies, "the setpoint is only a copy of the estimate", reasons)
    long = [span for span in kept if all(_rows(s, span) >= FEWEST for s in (setpoint, response))]
    kept = _cut(kept, long, f"a window contains fewer than {FEWEST} rows", reasons)
    return tuple(kept), tuple(reasons)


def _cut(kept: Windows, allowed: Windows, reason: str, reasons: list[str]) -> Windows:
    """The part of the windows that is allowed; the rest is added to the reasons."""
    left = shared(kept, allowed)
    lost = length(kept) - length(left)
    if lost > 1e-3 * length(kept):  # not for a row at an end
        reasons.append(f"{lost:.4g} s are left out: {reason}")
    return left


def _rows(series: Series, window: tuple[float, float]) -> int:
    low, high = np.searchsorted(series.time, window)
    return int(high - low)


def _copies(setpoint: Series, response: Series) -> Windows:
    """Where the setpoint moves and takes the values of the response, a few rows late at most.

    Firmware resets the setpoint of a loop that is not closed to the estimate. Log rows of both
    may be a row or two apart, so the setpoint is compared with the response around its time, as
    many rows late throughout. A setpoint that rests, or that moves slowly over coarse steps, equals
    the response of a closed loop now and then; that is no copy.
    """
    values = setpoint.values
    nearest = np.searchsorted(response.time, setpoint.time)
    copied = np.zeros(values.size, dtype=bool)
    for shift in (-3, -2, -1, 0, 1):
        found = response.values[np.clip(nearest + shift, 0, len(response) - 1)]
        for first, stop in runs(np.abs(values - found) <= 1e-6 * np.abs(values)):
            lasts = setpoint.time[stop - 1] - setpoint.time[first] >= COPY_LASTS
            if lasts and np.unique(values[first:stop]).size >= COPIED:
                copied[first:stop] = True
    return held_rows(setpoint.time, copied)
