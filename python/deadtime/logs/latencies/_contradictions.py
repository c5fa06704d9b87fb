"""Whether the times of a vehicle contradict each other.

The same controller and the same vehicle act to the north and to the east, through roll and pitch as
it heads. Where the interval of one lies far beyond that of the other, one of them at least is of
something else.
"""

from __future__ import annotations

from collections.abc import Iterator

from deadtime._base.digits import stated
from deadtime.logs.latencies._relation import LoopLatency

#: Axes that are alike, and the factor by which intervals may lie apart: roll and pitch differ.
ALIKE, APART = ("north", "east"), 2.0


def doubted_by_others(loops: list[LoopLatency]) -> list[LoopLatency]:
    """The times as indications, where others contradict them."""
    reliable = [fit for fit in loops if fit.verdict == "reliable"]
    found = []
    for loop in loops:
        judged = loop
        if loop.verdict == "reliable":
            for why in _by_axes(loop, reliable):
                judged = judged.doubted(why)
        found.append(judged)
    return found


def _by_axes(loop: LoopLatency, reliable: list[LoopLatency]) -> Iterator[str]:
    """Why the same loop of another axis contradicts this one."""
    for other in reliable:
        alike = (loop.kind, loop.command) == (other.kind, other.command)
        if not (alike and loop.axis != other.axis and {loop.axis, other.axis} <= set(ALIKE)):
            continue
        (low, high), (least, most) = loop.interval, other.interval
        if max(low, least) > APART * min(high, most):
            yield (
                f"{loop.axis} and {other.axis} contradict each other, because their times are "
                f"{stated(loop.time, loop.stderr, 's')} and "
                f"{stated(other.time, other.stderr, 's')}"
            )
