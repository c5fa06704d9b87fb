"""The time of a loop in full: what it is made of, what makes it doubtful, and what it costs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from deadtime._base.digits import shown, stated
from deadtime._base.verdicts import claimed, rough
from deadtime.logs.latencies._budget import Stage
from deadtime.logs.latencies._plain import Difference
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.logs.latencies._table import seen_in


def in_full(one: LoopLatency, stages: Sequence[Stage] = ()) -> list[str]:
    """All that is known of a loop that has a time, a line each."""
    lines = [one.headline(), *(f"  {words}" for words in said_of(one))]
    for name, measured, fitted in plain_rows(one):
        beside = f"; for the fit {fitted}" if fitted else ""
        lines.append(f"  {name}: {measured}{beside}")
    if one.command == "actuator":
        lines += [f"  {stage.line()}" for stage in stages if stage.part]
    return lines


def said_of(one: LoopLatency) -> list[str]:
    """What there is to say about a time, a sentence each."""
    fit = one.estimate
    assert fit is not None
    dead = claimed(one.verdict, fit.delay, _error(one), "s")
    said = [f"{fit.best.in_words()}, dead time {dead}, seen in {seen_in(one)}"]
    # Several checks may give the same reason.
    reasons = dict.fromkeys(one.reason.split("; ")) if one.verdict != "reliable" else {}
    said += [f"not reliable: {reason.removeprefix('not reliable: ')}" for reason in reasons]
    if one.spread is not None:
        said.append(one.spread.line())
    if one.cost is not None:
        said.append(cost_in_words(one))
    return said


def plain_rows(one: LoopLatency) -> list[tuple[str, str, str]]:
    """The plain numbers: the method, what it gives for the log, and what for the fit."""
    if one.plain is None:
        return []
    fitted = {each.name: _modelled(each) for each in one.differences}
    rows = []
    for plain in one.plain.all:
        name, _, measured = plain.line().partition(": ")
        rows.append((name, measured, fitted.get(plain.name, "")))
    return rows


def _modelled(one: Difference) -> str:
    """What a method gives for the fit, to the digits that its interval leaves."""
    error = 0.25 * (one.interval[1] - one.interval[0])
    if not math.isfinite(error):
        return rough(one.modelled, "s")
    return shown(one.modelled, error, "s")


def _error(one: LoopLatency) -> float:
    """A quarter of the interval of the dead time; NaN where it is not known."""
    assert one.estimate is not None
    low, high = one.estimate.intervals.get("delay", (math.nan, math.nan))
    return 0.25 * (high - low)


def cost_in_words(one: LoopLatency) -> str:
    """What delay and lag cost in gain, in a sentence."""
    cost = one.cost
    assert cost is not None
    half = 0.25 * (cost.largest_ci[1] - cost.largest_ci[0])
    damped = 0.25 * (cost.well_damped_ci[1] - cost.well_damped_ci[0])
    text = (
        f"a proportional gain is stable up to {claimed(one.verdict, cost.largest, half)}, and "
        f"well damped (Ms 1.7) up to {claimed(one.verdict, cost.well_damped, damped)}"
    )
    if cost.flown is not None:
        text += f"; {cost.flown:.3g} is flown"
        if cost.delay_margin is None or math.isnan(cost.delay_margin):
            text += ", which is not stable with this model"
        elif math.isfinite(cost.delay_margin):
            text += f", with a delay margin of {stated(cost.delay_margin, 0.0, 's')}"
    return text
