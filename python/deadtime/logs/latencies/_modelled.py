"""What a fitted plant answers to the setpoint of a log, at the rows of its response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs._series import Series
from deadtime.logs.latencies._commands import Between
from deadtime.loops import Plant, open_response

#: Steps that stand for a straight line between two rows: their error is that many squared smaller
#: than that of one step.
FINER = 8


def modelled(
    plant: Plant,
    delay: float,
    setpoint: Series,
    response: Series,
    segments: Sequence[tuple[float, float]],
    between: Between,
) -> Series:
    """The response of a plant with a delay, s, to a setpoint; NaN outside of the segments.

    The plant rests under the first setpoint of the log and follows all that come after it, with
    the loop closed or not: where a segment begins, that is the best guess of its state.
    """
    inside = np.zeros(len(response), dtype=bool)
    for low, high in segments:
        inside |= (response.time >= low) & (response.time <= high)
    values = np.full(len(response), np.nan)
    asked, commands = _held(setpoint, between)
    if inside.any() and asked.size:
        # Before the first command the plant rests under it.
        times = np.maximum(response.time[inside] - delay, asked[0])
        later, place = np.unique(times, return_inverse=True)
        values[inside] = open_response(plant, plant.parameters, later, asked, commands)[place]
    return replace(response, values=values, source="fit", conversion="")


def _held(setpoint: Series, between: Between) -> tuple[Array, Array]:
    """Times and values of a setpoint as one that holds, straight lines in fine steps."""
    known = np.isfinite(setpoint.values)
    time, values = setpoint.time[known], setpoint.values[known]
    if between == "held" or time.size < 2:
        return time, values
    rows = np.arange(time.size)
    starts = np.arange(FINER * (time.size - 1)) / FINER
    middles = np.interp(starts + 0.5 / FINER, rows, values)
    return np.append(np.interp(starts, rows, time), time[-1]), np.append(middles, values[-1])
