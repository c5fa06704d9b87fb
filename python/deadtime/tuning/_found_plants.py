"""The plants that an estimate leaves possible, as points around the likeliest one.

The dead time is known worse than its sum with the lags, so that a plant with a longer dead time has
a shorter lag. At each end of the interval of the dead time the largest lag keeps the sum, and at
each end of the sum the dead time is the likeliest. A zero moves with the lag. Each of these is
taken with both ends of the gain. Other kinds of plant that are not ruled out stand beside them,
with their own likeliest numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from deadtime.estimation import PlantEstimate
from deadtime.loops import Controller, ControlLoop

#: Lead in BIC from which another kind of plant is ruled out, as the estimate has it.
CLEAR = 10.0

#: Most other kinds of plant. More: longer designs; fewer: a kind that is not ruled out is left out.
KINDS = 4

#: Least lag, as a share of the likeliest.
LEAST = 0.02

#: Names of the largest lag, as plants have it.
LAGS = ("lag", "time_constant", "lag_1")


def possible_loops(
    fit: PlantEstimate,
    controller: Controller,
    level: float,
    sample_time: float | None = None,
    limit: float | None = None,
) -> list[ControlLoop]:
    """The loops around all plants that are possible, that of the likeliest first."""
    loop = fit.loop(controller, sample_time=sample_time, limit=limit)
    shapes = [{"delay": fit.delay}, *_shapes(fit, loop, level)]
    gains = fit.ci(level, "gain") if "gain" in fit.intervals else (loop.parameters["gain"],)
    around = [
        loop.replace(**numbers, gain=gain) for numbers, gain in itertools.product(shapes, gains)
    ]
    rivals = [candidate for candidate in fit.candidates[1:] if candidate.behind < CLEAR][:KINDS]
    return [loop, *around, *(loop.replace(plant=kind.plant, delay=kind.delay) for kind in rivals)]


def refusal(fit: PlantEstimate) -> str | None:
    """Why an estimate is not to be relied on; None where it is."""
    return None if fit.verdict == "reliable" else fit.reason or fit.verdict


def _shapes(fit: PlantEstimate, loop: ControlLoop, level: float) -> Iterator[dict[str, float]]:
    """Dead time and lag at the ends of the dead time, of its sum with the lags, and of the lag."""
    numbers = loop.plant.parameters
    name = next((parameter for parameter in LAGS if numbers.get(parameter)), None)
    if name is None:
        yield from ({"delay": late} for late in fit.ci(level, "delay"))
        return
    own, least = numbers[name], LEAST * numbers[name]
    for late in fit.ci(level, "delay"):
        yield {"delay": late, name: max(own + fit.delay - late, least)}
    if "delay+lag" in fit.intervals:
        for total in fit.ci(level, "delay+lag"):
            yield {"delay": fit.delay, name: max(own + total - fit.delay_plus_lag, least)}
    if numbers.get("zero") and "lag" in fit.intervals:
        for lag in fit.ci(level, "lag"):
            more = max(lag, least) - own
            yield {"delay": fit.delay, name: own + more, "zero": numbers["zero"] + more}
