"""Estimates of a latency report in words."""

from __future__ import annotations

import math

from deadtime._base.digits import stated
from deadtime._base.verdicts import claimed
from deadtime.estimation import DelayEstimate, unit_of
from deadtime.logs.latencies._relation import LoopLatency


def numbers_of(fit: DelayEstimate) -> list[str]:
    """Every number of the fitted plant, with its standard error."""
    single = sum(name.startswith("lag") for name in fit.free) == 1
    found = []
    for name in fit.free:
        value, error = fit._value(name), fit.stderr[name]
        if not 0.0 < error < abs(value):
            # Two equal lags, and a number at its bound, have no such error but an interval.
            low, high = fit.ci(0.95, name)
            error = (high - low) / 3.92
        shown = "lag" if single and name == "lag_1" else name.replace("_", " ")
        found.append(f"{shown} {claimed(fit.verdict, value, error, unit_of(name))}")
    return found


def said_of(one: LoopLatency) -> list[str]:
    """The time of a loop that was not refused, what it is made of, doubts, and what it costs."""
    fit = one.estimate
    assert fit is not None
    said = [one.headline(), ", ".join(numbers_of(fit))]
    if fit.verdict != "reliable":
        said.append(f"not reliable: {fit.reason}")
    if one.cost is not None:
        said.append(cost_in_words(one))
    return said


def cost_in_words(one: LoopLatency) -> str:
    """What delay and lag cost in gain, in a sentence."""
    cost = one.cost
    assert cost is not None
    assert one.estimate is not None
    verdict = one.estimate.verdict
    half = 0.25 * (cost.largest_ci[1] - cost.largest_ci[0])
    damped = 0.25 * (cost.well_damped_ci[1] - cost.well_damped_ci[0])
    text = (
        f"a proportional gain is stable up to {claimed(verdict, cost.largest, half)} and well "
        f"damped (Ms 1.7) up to {claimed(verdict, cost.well_damped, damped)}"
    )
    if cost.flown is not None:
        text += f"; {cost.flown:.3g} is flown"
        if cost.delay_margin is None or math.isnan(cost.delay_margin):
            text += ", which this model says is not stable"
        elif math.isfinite(cost.delay_margin):
            text += f", which leaves a delay margin of {stated(cost.delay_margin, 0.0, 's')}"
    return text
