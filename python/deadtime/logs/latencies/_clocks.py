"""Whether a response and its command are stamped by clocks that drift apart.

Two clocks whose rates differ by r make the time from command to response grow by r each second.
Rows that come regularly on both clocks show r by their stamps: their periods are in the ratio m/n
of small whole numbers, times 1 + r. Two tasks that are run by oscillators of their own, and stamped
by one clock, look the same; there the time from command to response does not grow. It is measured
in windows over the log, and a line is fitted through these times.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import stated
from deadtime.logs.latencies._relation import TWO_SIDED, LoopLatency, WindowTime

#: Largest whole number of rows of one signal in a whole number of the other's, and the largest
#: difference of two clocks that run on quartz.
WHOLE, QUARTZ = 8, 3e-4

#: Farthest stamp from its regular time, in rows, at which the number of a row is known.
FARTHEST = 0.45

#: Fewest rows whose stamps tell their rate.
FEWEST = 50

#: Level of the test of a line of times.
SIGNIFICANCE = 0.01

#: Windows below which a line of times says nothing about its error.
LEAST = 3

#: Drift over the log that matters, as a share of the 95 % interval: the interval then covers 93 %.
LEAST_DRIFT = 0.1

#: Name of a signal, and the stamps of its rows, s.
Stamped: TypeAlias = tuple[str, Array]


class Rate(NamedTuple):
    """A relative difference of clocks, or a time between rows, s, and its largest error.

    That is relative, too.
    """

    value: float
    most: float


class Growth(NamedTuple):
    """By how much a time grows, s a second, its standard error, and its quantile of 99 %.

    `start` and `start_error` are how much later than the estimate the response came at the start
    of the log, s.
    """

    value: float
    error: float
    quantile: float
    start: float
    start_error: float

    def may_be(self, value: float) -> bool:
        """Whether the growth is not told from this one."""
        return abs(self.value - value) <= self.quantile * self.error


def why_two_clocks(found: LoopLatency, command: Stamped, response: Stamped) -> str:
    """Why the clocks of a log make a time doubtful; empty where they do not.

    Parameters
    ----------
    found : LoopLatency
        The time.
    command, response : (str, ndarray)
        Name and stamps of each signal.
    """
    start, stop = response[1][[0, -1]].tolist()
    length = stop - start
    low, high = found.interval
    allowed = LEAST_DRIFT * (high - low)
    names = f"{command[0]} and {response[0]}"
    stamps = rate_of_drift(command[1], response[1])
    drift = 0.0 if stamps is None or abs(stamps.value) <= stamps.most else stamps.value
    grows = growth_of(found.times, found.time, start)
    if grows is not None and not grows.may_be(0.0) and abs(grows.value) * length > allowed:
        by = stated(grows.value, grows.error, "s")
        error = math.hypot(grows.start_error, (high - low) / TWO_SIDED)
        first = stated(found.time + grows.start, error, "s")
        also = f", whose time stamps drift apart by {1e6 * abs(drift):.3g} ppm" if drift else ""
        return (
            f"the time from command to response grows by {by} each second, from {first} at the "
            f"start of the log. Either the clocks of {names} drift apart{also}, or the vehicle "
            "changes"
        )
    if abs(drift) * length <= allowed or not (grows is None or grows.may_be(drift)):
        return ""
    return (
        f"the time stamps of {names} drift apart by {1e6 * abs(drift):.3g} ppm. If they come "
        f"from two clocks, the time is wrong by {stated(abs(drift), 0.0, 's')} for each second "
        "since the two clocks agreed"
    )


def rate_of_drift(sent: Array, received: Array) -> Rate | None:
    """By how much faster the stamps of a response advance; None where rows are not regular."""
    ours, theirs = _period(sent), _period(received)
    if ours is None or theirs is None:
        return None
    ratio = theirs.value / ours.value
    whole = min(_whole_ratios(), key=lambda candidate: abs(ratio / candidate - 1.0))
    drift = ratio / whole - 1.0
    return Rate(drift, ours.most + theirs.most) if abs(drift) < QUARTZ else None


def _whole_ratios() -> set[float]:
    """Ratios of small whole numbers."""
    few = range(1, WHOLE + 1)
    return {float(Fraction(m, n)) for m in few for n in few}


def _period(time: Array) -> Rate | None:
    """The time between rows, s, and its relative error; None where rows are not regular.

    Stamps that are at most d from the line through them cannot turn it by more than 2 d over its
    length.
    """
    if time.size < FEWEST:
        return None
    steps = np.diff(time)
    # The mean of single steps: the median of scattered ones is off where others are missing.
    between = float(np.mean(steps[steps < 1.5 * np.median(steps)]))
    number = np.concatenate([[0.0], np.cumsum(np.rint(steps / between))])
    if number[-1] < FEWEST:
        return None
    line = np.polynomial.Polynomial.fit(number, time, 1)
    off = float(np.max(np.abs(time - line(number))))
    period = float(line.convert().coef[1])
    if off > FARTHEST * period:
        return None
    return Rate(period, 2.0 * off / float(time[-1] - time[0]))


def growth_of(each: Sequence[WindowTime], time: float, start: float) -> Growth | None:
    """By how much the times of windows grow over a log; None where it is not known.

    The scatter of the times around their line widens its error where it is more than their own.
    The errors of the best half are taken for their median: in gusts some are far too small.
    """
    from scipy import special

    if len(each) < LEAST:
        return None
    at, times, errors = np.array([(part.at, part.time - time, part.stderr) for part in each]).T
    errors = np.maximum(errors, np.median(errors))
    rows = np.stack([np.ones(at.size), at - start], axis=1) / errors[:, None]
    (first, slope), *_ = np.linalg.lstsq(rows, times / errors)
    left = times / errors - rows @ (first, slope)
    freedom = at.size - 2
    scale = max(1.0, float(left @ left) / freedom)
    first_error, error = np.sqrt(scale * np.diag(np.linalg.inv(rows.T @ rows))).tolist()
    quantile = float(special.stdtrit(freedom, 1.0 - SIGNIFICANCE / 2))
    return Growth(float(slope), error, quantile, float(first), first_error)
