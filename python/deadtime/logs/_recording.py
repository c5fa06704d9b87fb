"""A loop of a log as a recording."""

from __future__ import annotations

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime.logs._series import Series
from deadtime.recordings import Columns, Recording, repeated_rows

#: Commands are kept from as long before the first row, in lengths of the part.
EARLIER = 0.5


def recording_of(
    name: str,
    setpoint: Series | None,
    response: Series,
    command: Series,
    part: tuple[float | None, float | None],
) -> Recording:
    """The response of a loop, and what it is told, over a part of the log.

    Rows in which the response is an old one, read once and logged again, are left out.
    """
    start, stop = part
    low = -np.inf if start is None else start
    high = np.inf if stop is None else stop
    sent, values = _commands_of(command, high)
    low = max(low, float(sent[0])) if sent.size else np.inf
    time, output = response.time, response.values
    rows = (time >= low) & (time <= high) & np.isfinite(output)
    if not rows.any():
        raise RecordingError(
            f"from {low:g} to {high:g} s, {name} has no rows in which it follows {command.source}"
        )
    time, output = time[rows], output[rows]
    fresh = np.ones(time.size, dtype=bool)
    fresh[repeated_rows(Columns(time, np.zeros_like(time), output, None))] = False
    time, output = time[fresh], output[fresh]
    kept = sent >= time[0] - EARLIER * (time[-1] - time[0])
    kept |= sent >= sent[np.searchsorted(sent, time[0], side="right") - 1]
    units = {"output": response.unit, "command": command.unit}
    if setpoint is not None:
        units["reference"] = setpoint.unit
    return Recording(
        time,
        None if setpoint is None else _held(setpoint, time),
        output,
        units={signal: unit for signal, unit in units.items() if unit},
        source=f"{name}, {command.source} to {response.source}",
        sent=(sent[kept], values[kept]),
    )


def _commands_of(command: Series, stop: float) -> tuple[Array, Array]:
    """Times and values of the commands up to `stop` and of the next one, all that are a number."""
    known = np.isfinite(command.values)
    time, values = command.time[known], command.values[known]
    kept = int(np.searchsorted(time, stop, side="right")) + 1
    return time[:kept], values[:kept]


def _held(series: Series, time: Array) -> Array:
    """The last value of a series at each time, the first where there is none before."""
    known = np.isfinite(series.values)
    rows = np.searchsorted(series.time[known], time, side="right") - 1
    return np.asarray(series.values[known][np.maximum(rows, 0)])
