"""A loop of a log as a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from deadtime._base.errors import RecordingError
from deadtime.recordings._recording import Recording
from deadtime.recordings.logs._contents import Array
from deadtime.recordings.logs._series import Series

if TYPE_CHECKING:
    from deadtime.recordings.logs._log import LogLoop

#: A signal that changes on more than this share of its rows moves between them.
MOVES = 0.5

#: Commands are kept from as long before the first row, in lengths of the part.
EARLIER = 0.5


def recording_of(
    loop: LogLoop,
    start: float | None,
    stop: float | None,
    command: str,
    between: str | None = None,
) -> Recording:
    """The response of a loop, and what it answers to, over a part of the log."""
    if command not in ("setpoint", "actuator"):
        raise ValueError(f"command={command!r} is not one of 'setpoint', 'actuator'")
    if between not in (None, "held", "lines"):
        raise ValueError(f"between={between!r} is not one of 'held', 'lines', None")
    told = loop.setpoint if command == "setpoint" else loop.actuator
    if told is None:
        raise RecordingError(f"the log does not hold what the controller of {loop.name} commands")
    if start is None and stop is None:
        if not loop.segments:
            raise RecordingError(f"{loop.name} is never followed: {'; '.join(loop.why_left_out)}")
        start, stop = max(loop.segments, key=lambda ends: ends[1] - ends[0])
    low = -np.inf if start is None else start
    high = np.inf if stop is None else stop
    lines = moves(told) if between is None else between == "lines"
    sent, values = commands_of(told, high, lines)
    low = max(low, float(sent[0])) if sent.size else np.inf
    time, output = loop.response.time, loop.response.values
    rows = (time >= low) & (time <= high) & np.isfinite(output)
    if not rows.any():
        raise RecordingError(
            f"{loop.name} has no rows from {low:g} to {high:g} s that follow a {command}"
        )
    time, output = time[rows], output[rows]
    kept = sent >= time[0] - EARLIER * (time[-1] - time[0])
    kept |= sent >= sent[np.searchsorted(sent, time[0], side="right") - 1]
    units = {"output": loop.response.unit, "reference": loop.setpoint.unit, "command": told.unit}
    return Recording(
        time,
        _held(loop.setpoint, time),
        output,
        units={name: unit for name, unit in units.items() if unit},
        source=f"{loop.name}, {told.source} to {loop.response.source}",
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
