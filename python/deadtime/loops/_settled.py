"""Whether a response that is in its settling band at the end of a run stays there.

A response may pass through the band, or leave it slowly after the end of the run. It counts as
settled if it has been inside for three of the slowest time constants of the closed loop,
1/abs(abscissa), and the command within its limit: at the limit the loop is open, and its integral
may have to unwind. Where the reference needs the whole limit or more, the command rests there, and
the time constants are those of plant and controller alone.

To ask the poles of a loop takes longer than its simulation, so they are asked in two cases only: if
the response had not decayed to well within the band, or if a pole or zero of plant or controller is
slow compared with the simulated time. Closed-loop poles are slow close to these, or close to the
stability limit, where the response oscillates. Where the simulated time is given, a count of the
slow poles of a continuous loop is enough; where it is to be found, they are computed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array, Mask
from deadtime._base.errors import ConvergenceError
from deadtime.loops._specification import LoopSpecification

#: Time for which a response must have been in its band to count as settled, in slowest time
#: constants of the closed loop: more misjudge fewer responses, and take longer simulations.
TIME_CONSTANTS = 3.0

#: Part of the limit by which the command at rest may be below it and counts as at it: more covers
#: larger rounding errors, and takes more commands near the limit for ones at it.
_AT_LIMIT = 1e-12


def rests_at_limit(command: ArrayLike, bounds: tuple[ArrayLike, ArrayLike]) -> Mask:
    """Whether the command that the reference needs at rest is at one of its bounds, or beyond."""
    low, high = (np.multiply(bound, 1.0 - _AT_LIMIT) for bound in bounds)
    return np.asarray((np.asarray(command) >= high) | (np.asarray(command) <= low))


def time_inside(
    settled: ArrayLike, limited_until: ArrayLike, end: float, rests: ArrayLike
) -> tuple[Array, Mask]:
    """For how long before `end` responses were in their bands under the same poles, s.

    `settled` are the times since which they are in their bands, NaN for none, and `limited_until`
    the last times at which commands were at their limits. Returns also which commands stay there:
    those that are there at the end and have to be (`rests`).
    """
    stays = np.logical_and(rests, np.greater_equal(limited_until, end))
    return end - np.where(stays, settled, np.maximum(settled, limited_until)), np.asarray(stays)


def counts_as_settled(inside: ArrayLike, rates: ArrayLike) -> Mask:
    """Whether responses were inside long enough, by the decay rates of their slowest modes, 1/s."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.multiply(inside, rates) >= TIME_CONSTANTS)


def slowest_rates(times: ArrayLike) -> Array:
    """Decay rates in 1/s of plants and controllers with these slowest time constants, s."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.divide(1.0, times))


def stays_settled(
    loop: LoopSpecification, times: Array, inputs: Array, command: float | None, settled: float
) -> bool:
    """Whether a simulated response stays in the band in which it is since `settled`, s.

    It is a matter of the loop only if its command was or is to be at the limit. `times` count from
    the start, `command` is that at rest without limits, None without a rest.
    """
    if (loop.limit is None and loop.rate_limit is None) or not np.isfinite(settled):
        return True
    low, high = loop.bounds
    rests = command is not None and bool(rests_at_limit(command, loop.bounds))
    limited = np.flatnonzero((inputs >= high) | (inputs <= low))
    if not (limited.size or rests):
        return True
    # The command left its limit before the output after the last one at which it was there.
    last = min(int(limited[-1]) + 1, len(times) - 1) if limited.size else 0
    inside, stays = time_inside(settled, float(times[last]), float(times[-1]), rests)
    try:
        rate = slowest_rates(loop.kernel.slowest_time()) if stays else -loop.abscissa_at({})
    except ConvergenceError:
        return False
    return bool(counts_as_settled(inside, rate))
