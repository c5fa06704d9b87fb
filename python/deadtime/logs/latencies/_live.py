"""The explorer of a proportional controller around an estimated vehicle, for the page.

A fit from setpoint to response is a closed loop, whose controller is inside of it. One from what
the controller commands is the vehicle alone, and its cost in gain is about a gain around that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from deadtime._base.explorer import Explorer
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.loops import P, explorer_of

#: Ends of the map, as a share of the largest stable gain, and of delay and lag together.
_BEYOND = 1.5


@dataclass(frozen=True)
class Around:
    """A loop around the vehicle, and which it is."""

    explorer: Explorer
    words: str


def around_the_vehicle(estimated: Sequence[LoopLatency]) -> Around | None:
    """The loop with the gain flown, or else the well damped one; None where no fit is reliable.

    Of several vehicles, such as that of the rate and that of the angle, the one whose gain is
    known, and then the one of the least error.
    """
    reliable = [
        fit
        for fit in estimated
        if fit.cost
        and fit.verdict == "reliable"
        and fit.estimate
        and fit.estimate.verdict != "none"
    ]
    if not reliable:
        return None
    fit = min(reliable, key=lambda fit: (_flown(fit) is None, fit.stderr))
    assert fit.estimate is not None
    assert fit.cost is not None
    gain = _flown(fit)
    which = "the gain that the vehicle uses" if gain is not None else "the well damped gain"
    words = (
        f"Loop: the vehicle as estimated ({fit.name}), with a proportional controller of the "
        f"{fit.loop} that has {which}. The largest stable gain is for this loop, without other "
        "terms of the controller. The interval is for the delay, with gain and lag as "
        "estimated."
    )
    controller = P(fit.cost.well_damped if gain is None else gain)
    widest, longest = (float(f"{_BEYOND * end:.2g}") for end in (fit.cost.largest, fit.time))
    ranges = {"Kp": (min(widest, 0.0), max(widest, 0.0)), "delay": (0.0, longest)}
    loop = fit.estimate.loop(controller)
    return Around(explorer_of(loop.specification, ranges, fit.estimate.ci()), words)


def _flown(fit: LoopLatency) -> float | None:
    """The proportional gain of the log, if it is one with which the model is stable."""
    cost = fit.cost
    if cost is None or cost.flown is None or cost.delay_margin is None:
        return None
    return None if math.isnan(cost.delay_margin) else cost.flown
