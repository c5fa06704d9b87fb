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


def in_full(loop: LoopLatency, stages: Sequence[Stage] = ()) -> list[str]:
    """All that is known of a loop that has a time, a line each."""
    lines = [loop.headline(), *(f"  {words}" for words in said_of(loop))]
    for name, measured, fitted in plain_rows(loop):
        beside = f"; for the fit {fitted}" if fitted else ""
        lines.append(f"  {name}: {measured}{beside}")
    if loop.command == "actuator":
        lines += [f"  {stage.line()}" for stage in stages if stage.part]
    return lines


def said_of(loop: LoopLatency) -> list[str]:
    """What there is to say about a time, a sentence each."""
    fit = loop.estimate
    assert fit is not None
    dead = claimed(loop.verdict, fit.delay, _error(loop), "s")
    said = [f"{fit.best.in_words()}, dead time {dead}, seen in {seen_in(loop)}"]
    # Several checks may give the same reason.
    reasons = dict.fromkeys(loop.reason.split("; ")) if loop.verdict != "reliable" else {}
    said += [f"not reliable: {reason.removeprefix('not reliable: ')}" for reason in reasons]
    if loop.spread is not None:
        said.append(loop.spread.line())
    if loop.cost is not None:
        said.append(cost_in_words(loop))
    return said


def plain_rows(loop: LoopLatency) -> list[tuple[str, str, str]]:
    """The plain numbers: the method, what it gives for the log, and what for the fit."""
    if loop.plain is None:
        return []
    fitted = {each.name: _modelled(each) for each in loop.differences}
    rows = []
    for plain in loop.plain.all:
        name, _, measured = plain.line().partition(": ")
        rows.append((name, measured, fitted.get(plain.name, "")))
    return rows


def _modelled(difference: Difference) -> str:
    """What a method gives for the fit, to the digits that its interval leaves."""
    error = 0.25 * (difference.interval[1] - difference.interval[0])
    if not math.isfinite(error):
        return rough(difference.modelled, "s")
    return shown(difference.modelled, error, "s")


def _error(loop: LoopLatency) -> float:
    """A quarter of the interval of the dead time; NaN where it is not known."""
    assert loop.estimate is not None
    low, high = loop.estimate.intervals.get("delay", (math.nan, math.nan))
    return 0.25 * (high - low)


def cost_in_words(loop: LoopLatency) -> str:
    """What delay and lag cost in gain, in a sentence."""
    cost = loop.cost
    assert cost is not None
    half = 0.25 * (cost.largest_ci[1] - cost.largest_ci[0])
    damped = 0.25 * (cost.well_damped_ci[1] - cost.well_damped_ci[0])
    text = (
        f"a proportional gain is stable up to {claimed(loop.verdict, cost.largest, half)}, and "
        f"well damped (Ms 1.7) up to {claimed(loop.verdict, cost.well_damped, damped)}"
    )
    if cost.flown is not None:
        text += f"; {cost.flown:.3g} is flown"
        if cost.delay_margin is None or math.isnan(cost.delay_margin):
            text += ", which is not stable with this model"
        elif math.isfinite(cost.delay_margin):
            text += f", with a delay margin of {stated(cost.delay_margin, 0.0, 's')}"
    return text
