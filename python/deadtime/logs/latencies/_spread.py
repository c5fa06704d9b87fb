"""Times of many windows together: their mean, the spread between them, and its cause.

Window i gives a time t_i with a standard error s_i. Around a line in some x_i, or a mean alone,

    t_i = x_i b + u_i + e_i,    u_i of variance tau^2,  e_i of variance s_i^2.

tau^2 is found by moments, as DerSimonian and Laird (1986) do it for a mean and Raudenbush (2009)
for a line: with w_i = 1/s_i^2 and Q the weighted squares left, Q = k - p + C tau^2 on average. The
interval is that of Hartung and Knapp (2001; Knapp and Hartung 2003 for a line): the variance of
b by the weighted squares left under 1/(s_i^2 + tau^2), t quantile of k - p degrees. Where these
squares are smaller than on average, the average counts, so that few windows which happen to agree
get no narrower interval than their errors give.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.digits import between as ends_of, stated
from deadtime._base.plain import plain_fields
from deadtime._base.verdicts import rough

#: Fewest windows of a mean, and of a slope on the size of the movement.
FEWEST, FEWEST_OF_SLOPE = 2, 4

#: Least range of sizes, as a factor, over which a slope is given.
RANGE = 1.5


@dataclass(frozen=True)
class Spread:
    """What many windows say about a time.

    Attributes
    ----------
    count : int
        Windows with a time and an error.
    mean, stderr : float
        Mean over windows and its standard error, s.
    interval : (float, float)
        Interval of the mean of Hartung and Knapp, s.
    between : float
        Standard deviation of the true times between windows, s.
    heterogeneity : float
        Share of the variance between the times that their errors do not explain (I squared).
    p_value : float
        Probability of such a scatter, or a larger one, if all windows had the same time.
    slope, slope_interval : float, (float, float)
        Change of the time, s, where the movement is e times as large; NaN where the sizes of the
        windows are not known, too few or too alike.
    """

    count: int
    mean: float
    stderr: float
    interval: tuple[float, float]
    between: float
    heterogeneity: float
    p_value: float
    slope: float
    slope_interval: tuple[float, float]

    def line(self) -> str:
        """The spread in one line."""
        if math.isnan(self.interval[0]):
            return f"{self.count} windows are too few to estimate the spread between windows"
        text = (
            f"{self.count} windows with a mean of {stated(self.mean, self.stderr, 's')} (95 %: "
            f"{ends_of(*self.interval, self.stderr, 's')}) and a standard deviation of "
            f"{rough(self.between, 's')}"
        )
        if (halved := self.halved()) is not None:
            way = "longer" if halved[0] > 0.0 else "shorter"
            text += (
                f". The time is {stated(abs(halved[0]), halved[1], 's')} {way} if the command "
                "moves half as much"
            )
        return text

    def halved(self) -> tuple[float, float] | None:
        """By how much longer it takes where it moves half as much, and the error of that, s.

        None where that may be zero, or is not known.
        """
        low, high = self.slope_interval
        if not (low > 0.0 or high < 0.0):
            return None
        # Per factor of two, which is easier to think of than e.
        half = math.log(2.0)
        return -half * self.slope, 0.25 * half * (high - low)

    def to_dict(self) -> dict[str, Any]:
        """The spread as plain values for JSON."""
        return plain_fields(vars(self))


class _Line(NamedTuple):
    """Weighted regression: numbers, covariance, variance between, squares left, degrees."""

    numbers: Array
    covariance: Array
    between: float
    left: float
    degrees: int


def spread_of(
    times: ArrayLike, errors: ArrayLike, sizes: ArrayLike | None = None, *, level: float = 0.95
) -> Spread:
    """Combine the times of windows, with the spread between them.

    Parameters
    ----------
    times, errors : array_like, shape (k,)
        Time of each window and its standard error, s. Windows without a finite time or a finite
        error above zero do not count.
    sizes : array_like, shape (k,), optional
        How much the setpoint moves in each, above zero; for the slope.
    level : float
        Probability of the intervals.

    Returns
    -------
    Spread
        NaN in the intervals for fewer than two windows.

    Raises
    ------
    ValueError
        If the shapes differ.

    Examples
    --------
    >>> found = spread_of([0.10, 0.12, 0.11, 0.13], [0.005] * 4)
    >>> round(found.mean, 4), round(found.between, 4), round(found.heterogeneity, 2)
    (0.115, 0.0119, 0.85)
    """
    from scipy.special import chdtrc, stdtrit

    time, error = (np.asarray(values, dtype=float) for values in (times, errors))
    size = np.full(time.shape, np.nan) if sizes is None else np.asarray(sizes, dtype=float)
    if time.ndim != 1 or not time.shape == error.shape == size.shape:
        raise ValueError(
            f"times, errors and sizes have the shapes {time.shape}, {error.shape} and "
            f"{size.shape}: give one value of each for every window"
        )
    kept = np.isfinite(time) & np.isfinite(error) & (error > 0.0)
    time, error, size = time[kept], error[kept], size[kept]
    nothing = (math.nan, math.nan)
    count = int(time.size)
    if count < FEWEST:
        mean, stderr = (float(time[0]), float(error[0])) if count else nothing
        return Spread(count, mean, stderr, nothing, math.nan, math.nan, math.nan,
                      math.nan, nothing)  # fmt: skip
    line = _line(time, error, np.ones((count, 1)))
    mean, stderr = float(line.numbers[0]), math.sqrt(float(line.covariance[0, 0]))
    reach = float(stdtrit(line.degrees, 0.5 * (1.0 + level)))
    tau = math.sqrt(line.between)
    share = max(0.0, 1.0 - line.degrees / line.left) if line.left > 0.0 else 0.0
    slope, ends = _slope(time, error, size, level)
    return Spread(
        count, mean, stderr, (mean - reach * stderr, mean + reach * stderr), tau,
        share, float(chdtrc(line.degrees, line.left)), slope, ends,
    )  # fmt: skip


def _slope(
    time: Array, error: Array, size: Array, level: float
) -> tuple[float, tuple[float, float]]:
    """Slope of the time on the logarithm of the size, and its interval."""
    from scipy.special import stdtrit

    known = np.isfinite(size) & (size > 0.0)
    if np.count_nonzero(known) < FEWEST_OF_SLOPE or np.ptp(np.log(size[known])) < math.log(RANGE):
        return math.nan, (math.nan, math.nan)
    logs = np.log(size[known])
    columns = np.stack([np.ones(logs.size), logs - logs.mean()], axis=1)
    line = _line(time[known], error[known], columns)
    slope = float(line.numbers[1])
    reach = float(stdtrit(line.degrees, 0.5 * (1.0 + level)))
    reach *= math.sqrt(float(line.covariance[1, 1]))
    return slope, (slope - reach, slope + reach)


def _line(time: Array, error: Array, columns: Array) -> _Line:
    """The regression of this file's head."""
    degrees = int(columns.shape[0] - columns.shape[1])
    weight = error**-2.0
    _, inverse, left = _weighted(time, weight, columns)
    squares = columns.T @ (columns * (weight**2)[:, None])
    per_variance = float(np.sum(weight) - np.trace(inverse @ squares))
    between = max(0.0, (left - degrees) / per_variance)
    numbers, inverse, rest = _weighted(time, 1.0 / (error**2 + between), columns)
    return _Line(numbers, inverse * max(1.0, rest / degrees), between, left, degrees)


def _weighted(time: Array, weight: Array, columns: Array) -> tuple[Array, Array, float]:
    """Numbers of weighted least squares, their covariance, and the squares left."""
    inverse: Array = np.asarray(np.linalg.inv(columns.T @ (columns * weight[:, None])), dtype=float)
    numbers = inverse @ (columns.T @ (weight * time))
    left = time - columns @ numbers
    return numbers, inverse, float(np.sum(weight * left**2))
