"""A loop of a log as a recording."""

from __future__ import annotations

from typing import Literal

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime.logs._series import Series
from deadtime.recordings import Columns, Recording, repeated_rows

#: A signal that changes on more than this share of its rows moves between them.
MOVES = 0.5

#: Commands are kept from as long before the first row, in lengths of the part.
EARLIER = 0.5


def recording_of(
    name: str,
    setpoint: Series | None,
    response: Series,
    told: Series,
    part: tuple[float | None, float | None],
    between: Literal["held", "lines"] | None = None,
) -> Recording:
    """The response of a loop, and what it is told, over a part of the log.

    Rows in which the response is an old one, read once and logged again, are left out.
    """
    if between not in (None, "held", "lines"):
        raise ValueError(f"between={between!r} is not one of 'held', 'lines', None")
    start, stop = part
    low = -np.inf if start is None else start
    high = np.inf if stop is None else stop
    lines = moves(told) if between is None else between == "lines"
    sent, values = commands_of(told, high, lines)
    low = max(low, float(sent[0])) if sent.size else np.inf
    time, output = response.time, response.values
    rows = (time >= low) & (time <= high) & np.isfinite(output)
    if not rows.any():
        raise RecordingError(
            f"{name} has no rows from {low:g} to {high:g} s that follow {told.source}"
        )
    time, output = time[rows], output[rows]
    fresh = np.ones(time.size, dtype=bool)
    fresh[repeated_rows(Columns(time, np.zeros_like(time), output, None))] = False
    time, output = time[fresh], output[fresh]
    kept = sent >= time[0] - EARLIER * (time[-1] - time[0])
    kept |= sent >= sent[np.searchsorted(sent, time[0], side="right") - 1]
    units = {"output": response.unit, "command": told.unit}
    if setpoint is not None:
        units["reference"] = setpoint.unit
    return Recording(
        time,
        None if setpoint is None else _held(setpoint, time),
        output,
        units={signal: unit for signal, unit in units.items() if unit},
        source=f"{name}, {told.source} to {response.source}",
        sent=(sent[kept], values[kept]),
    )


def commands_of(told: Series, stop: float, lines: bool) -> tuple[Array, Array]:
    """Times and values of the commands up to `stop`, without those that are no number."""
    known = np.isfinite(told.values)
    time, values = told.time[known], told.values[known]
    kept = int(np.searchsorted(time, stop, side="right"))
    if lines:
        # The command after the last is one to which it moves.
        after = values[1 : kept + 1]
        until = np.append(after, values[-1:])[:kept] if after.size < kept else after
        return time[:kept], 0.5 * (values[:kept] + until)
    return time[:kept], values[:kept]


def moves(told: Series) -> bool:
    """Whether a signal changes on most of its rows, and so moves between them too."""
    values = told.values[np.isfinite(told.values)]
    changes = np.diff(values)
    return bool(changes.size and np.mean(changes != 0.0) > MOVES)


def _held(series: Series, time: Array) -> Array:
    """The last value of a series at each time, the first where there is none before."""
    known = np.isfinite(series.values)
    rows = np.searchsorted(series.time[known], time, side="right") - 1
    return np.asarray(series.values[known][np.maximum(rows, 0)])
