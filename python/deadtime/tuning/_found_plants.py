"""Loops around a plant that was found from a recording, over the intervals of its numbers."""

from __future__ import annotations

import itertools

from deadtime.estimation import PlantEstimate
from deadtime.loops import Controller, ControlLoop

#: Numbers of a plant with the name of their interval in an estimate; the largest time constant is
#: the lag of an integrator or that of a first-order plant.
_INTERVALS = {"delay": "delay", "gain": "gain", "time_constant": "lag", "lag": "lag"}

#: Least time, as a part of the estimate: a time constant of zero is no plant of first order.
_LEAST = 1e-3


def loops_around(
    found: PlantEstimate,
    controller: Controller,
    level: float,
    sample_time: float | None = None,
    limit: float | None = None,
) -> list[ControlLoop]:
    """The loop around the likeliest plant, then those with its numbers at the ends of intervals.

    All combinations of the ends of delay, gain and largest time constant: more than the region that
    they lie in together, since their errors belong together.
    """
    nominal = found.loop(controller, sample_time=sample_time, limit=limit)
    ends = {}
    for name, value in nominal.parameters.items():
        interval = _INTERVALS.get(name)
        if interval is None or interval not in found.intervals or value == 0.0:
            continue
        low, high = found.ci(level, interval)
        if name != "gain":
            low = max(low, 0.0 if name == "delay" else _LEAST * value)
        if low < high:
            ends[name] = (low, high)
    corners = itertools.product(*ends.values())
    return [nominal, *(nominal.replace(**dict(zip(ends, one, strict=True))) for one in corners)]


def refusal(found: PlantEstimate) -> str | None:
    """Why an estimate is not to be relied on; None where it is."""
    return None if found.verdict == "reliable" else found.reason or found.verdict
