"""Whether the times of a vehicle contradict each other.

The same controller and the same vehicle act to the north and to the east, through roll and pitch as
it heads. Where the interval of one lies far beyond that of the other, one of them at least is of
something else: in a short record with much air, a delay of seconds may be what fits best.

What a setpoint asks for passes the controller and then the actuator. So a response does not wait
longer for its setpoint than it takes, delay and lag together, from the actuator.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from deadtime._base.digits import between, stated
from deadtime.logs.latencies._relation import LoopLatency

#: Axes that are alike, and the factor by which intervals may lie apart: roll and pitch differ.
ALIKE, APART = ("north", "east"), 2.0


def doubted_by_others(loops: list[LoopLatency]) -> list[LoopLatency]:
    """The times as ones that are not reliable, where others contradict them."""
    told = [one for one in loops if one.estimate is not None and one.estimate.verdict == "reliable"]
    found = []
    for one in loops:
        estimate = one.estimate
        if estimate is not None and estimate.verdict == "reliable":
            for why in (*_by_axes(one, told), *_by_actuator(one, told)):
                estimate = estimate.doubted(why)
        found.append(replace(one, estimate=estimate))
    return found


def _by_axes(one: LoopLatency, told: list[LoopLatency]) -> Iterator[str]:
    """Why the same loop of another axis contradicts this one."""
    for other in told:
        alike = (one.kind, one.command) == (other.kind, other.command)
        if not (alike and one.axis != other.axis and {one.axis, other.axis} <= set(ALIKE)):
            continue
        (value, error, ends), (beside, other_error, others) = one.sum_of(), other.sum_of()
        if max(ends[0], others[0]) > APART * min(ends[1], others[1]):
            yield (
                f"{one.axis} and {other.axis} contradict each other: delay and lag are "
                f"{stated(value, error, 's')} and {stated(beside, other_error, 's')}"
            )


def _by_actuator(one: LoopLatency, told: list[LoopLatency]) -> Iterator[str]:
    """Why the response to the actuator contradicts that to the setpoint."""
    fit = one.estimate
    for other in told:
        if (one.command, other.command) != ("setpoint", "actuator") or one.loop != other.loop:
            continue
        _, error, (low, high) = other.sum_of()
        if fit is not None and fit.delay > high and fit.ci(0.95, "delay")[0] > high:
            yield (
                f"it would wait {stated(fit.delay, fit.stderr['delay'], 's')} for its setpoint, "
                f"where the actuator takes {between(low, high, error, 's')} in all"
            )
