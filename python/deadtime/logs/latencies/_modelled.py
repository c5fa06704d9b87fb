"""What a fitted plant answers to the setpoint of a log, at the rows of its response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from deadtime.logs._recording import commands_of
from deadtime.logs._series import Series
from deadtime.logs.latencies._controller import Between
from deadtime.loops import Plant, open_response


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
    told, commands = commands_of(setpoint, np.inf, between == "lines")
    if inside.any() and told.size:
        # Before the first command the plant rests under it.
        times = np.maximum(response.time[inside] - delay, told[0])
        later, place = np.unique(times, return_inverse=True)
        values[inside] = open_response(plant, plant.parameters, later, told, commands)[place]
    return replace(response, values=values, source="fit", conversion="")
