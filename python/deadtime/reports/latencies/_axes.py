"""Whether a vehicle takes about as long to the north as to the east.

The same controller and the same vehicle act on both, through roll and pitch as it heads. Where the
interval of one lies far beyond that of the other, one of them at least is of something else: in a
short record with much air, a delay of seconds may be what fits best.
"""

from __future__ import annotations

from dataclasses import replace

from deadtime._base.digits import stated
from deadtime.reports.latencies._relation import LoopLatency, doubted

#: Axes that are alike, and the factor by which intervals may lie apart: roll and pitch differ.
ALIKE, APART = ("north", "east"), 2.0


def doubted_by_axes(loops: list[LoopLatency]) -> list[LoopLatency]:
    """The times as ones that are not adequate, where north and east contradict each other."""
    found = list(loops)
    told = [
        (k, one)
        for k, one in enumerate(loops)
        if one.axis in ALIKE and one.estimate is not None and one.estimate.adequate
    ]
    for k, one in told:
        for _, other in told:
            alike = (one.kind, one.command) == (other.kind, other.command)
            if one.axis == other.axis or not alike or one.estimate is None:
                continue
            (value, error, ends), (beside, other_error, others) = one.sum_of(), other.sum_of()
            if max(ends[0], others[0]) > APART * min(ends[1], others[1]):
                why = (
                    f"{one.axis} and {other.axis} contradict each other: delay and lag are "
                    f"{stated(value, error, 's')} and {stated(beside, other_error, 's')}"
                )
                found[k] = replace(one, estimate=doubted(one.estimate, why))
    return found
