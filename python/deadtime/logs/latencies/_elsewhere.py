"""Whether another window of a log contradicts the estimate of the best ones.

A vehicle may take longer where it moves less, near the ground or in turns, and a window in much air
may be fitted by what the vehicle is not: the interval of the best windows then does not hold the
time of another window, nor that of the next flight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from deadtime._base.digits import stated
from deadtime._base.errors import DeadtimeError
from deadtime.estimation import DelayEstimate, OutputError, estimate_delay
from deadtime.recordings import Recording

#: Difference, in standard errors, that one in a hundred right estimates has.
APART = 2.58

#: Half of a 95 % interval in standard errors.
TWO_SIDED = 1.96


def contradiction(fit: DelayEstimate, others: Sequence[Recording], method: OutputError) -> str:
    """Which of the other windows contradicts an estimate, and by how much; empty if none does.

    The plant is that of the estimate. A window that is no reliable estimate by itself says nothing.
    """
    for one in others:
        try:
            other = estimate_delay(one, fit.loop, method=method, free=fit.free)
        except DeadtimeError:
            continue
        if other.verdict == "reliable" and _are_apart(*sorted((fit, other), key=_sum_of)):
            low, high = other.ci(0.95, "delay+lag")
            value = stated(_sum_of(other), (high - low) / (2.0 * TWO_SIDED), "s")
            start, stop = one.time[0], one.time[-1]
            return (
                f"the window from {start:.1f} to {stop:.1f} s of the log contradicts it: delay and "
                f"lag are {value} there"
            )
    return ""


def _sum_of(fit: DelayEstimate) -> float:
    return fit.delay_plus_lag


def _are_apart(less: DelayEstimate, more: DelayEstimate) -> bool:
    """Whether two times differ by more than the parts of their intervals that face each other."""
    above = less.ci(0.95, "delay+lag")[1] - _sum_of(less)
    below = _sum_of(more) - more.ci(0.95, "delay+lag")[0]
    return _sum_of(more) - _sum_of(less) > APART / TWO_SIDED * math.hypot(above, below)
