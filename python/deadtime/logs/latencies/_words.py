"""The times of a log in words: one table, and each loop in full."""

from __future__ import annotations

import math
from collections.abc import Sequence

from deadtime._base.digits import between, stated
from deadtime._base.verdicts import claimed
from deadtime.logs.latencies._budget import Stage
from deadtime.logs.latencies._relation import LoopLatency

#: Most rows of the table, and most lines below it.
ROWS, BELOW = 15, 5

#: Heads of the table.
HEADS = ("loop", "from", "time", "95 %", "verdict", "windows", "well damped", "flown")


def row_of(one: LoopLatency) -> tuple[str, ...]:
    """A loop in the table of times."""
    if one.verdict == "none":
        return (one.loop, one.command, "—", "", "none", "", "", "")
    reliable = one.verdict == "reliable"
    time = claimed(one.verdict, one.time, one.stderr, "s")
    ends = between(*one.interval, one.stderr, "s") if reliable else ""
    return (one.loop, one.command, time, ends, one.verdict, str(len(one.times)), *_gains(one))


def _gains(one: LoopLatency) -> tuple[str, str]:
    """The well damped gain, and the one that is flown."""
    cost = one.cost
    if cost is None:
        return "", ""
    low, high = cost.well_damped_ci
    flown = "" if cost.flown is None else f"{cost.flown:.3g}"
    return claimed(one.verdict, cost.well_damped, 0.25 * (high - low)), flown


def shown_in_table(loops: Sequence[LoopLatency]) -> list[LoopLatency]:
    """The loops of the table: those with a time first where there are too many."""
    if len(loops) <= ROWS:
        return list(loops)
    order = ("reliable", "indication", "none")
    best = sorted(range(len(loops)), key=lambda k: (order.index(loops[k].verdict), k))[:ROWS]
    return [loops[k] for k in sorted(best)]


def table_of(loops: Sequence[LoopLatency], advice: Sequence[str]) -> list[str]:
    """One line a loop, and below it what is most worth knowing."""
    rows = [HEADS, *(row_of(one) for one in shown_in_table(loops))]
    used = [k for k in range(len(HEADS)) if any(row[k] for row in rows[1:])]
    widths = {k: max(len(row[k]) for row in rows) for k in used}
    lines = ["  ".join(f"{row[k]:<{widths[k]}}" for k in used).rstrip() for row in rows]
    return [*lines, "", *below(loops, advice)]


def below(loops: Sequence[LoopLatency], advice: Sequence[str]) -> list[str]:
    """At most five lines: what is most worth knowing, and what to do to know more."""
    lines = []
    if (left := len(loops) - ROWS) > 0:
        lines.append(f"{left} more loops: --verbose")
    for verdict in ("indication", "none"):
        alike = [one for one in loops if one.verdict == verdict]
        if alike:
            first, more = alike[0], len(alike) - 1
            also = f" ({more} more: --verbose)" if more else ""
            lines.append(f"{verdict}: {first.loop} from {first.command}: {first.reason}{also}")
    lines += advice
    return lines[:BELOW]


def in_full(one: LoopLatency, stages: Sequence[Stage] = ()) -> list[str]:
    """The time of a loop, what it is made of, what makes it doubtful, and what it costs."""
    if one.estimate is None:
        return [one.headline()]
    lines = [one.headline(), *(f"  {words}" for words in said_of(one))]
    if one.command == "actuator":
        lines += [f"  {stage.line()}" for stage in stages if stage.part]
    return lines


def said_of(one: LoopLatency) -> list[str]:
    """What there is to say about a time, a sentence each."""
    fit = one.estimate
    assert fit is not None
    said = [f"{fit.best.in_words()}, dead time {claimed(one.verdict, fit.delay, _error(one), 's')}"]
    if one.verdict != "reliable":
        said.append(f"not reliable: {one.reason}")
    if one.spread is not None:
        said.append(one.spread.line())
    if one.cost is not None:
        said.append(cost_in_words(one))
    return said


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
        f"a proportional gain is stable up to {claimed(one.verdict, cost.largest, half)} and well "
        f"damped (Ms 1.7) up to {claimed(one.verdict, cost.well_damped, damped)}"
    )
    if cost.flown is not None:
        text += f"; {cost.flown:.3g} is flown"
        if cost.delay_margin is None or math.isnan(cost.delay_margin):
            text += ", which this model says is not stable"
        elif math.isfinite(cost.delay_margin):
            text += f", which leaves a delay margin of {stated(cost.delay_margin, 0.0, 's')}"
    return text
