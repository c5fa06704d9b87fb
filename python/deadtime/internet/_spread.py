"""The mean of a delay over several runs, and its interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deadtime._base.digits import between

#: Width of a 95 % interval in standard errors.
TWO_SIDED = 3.92


@dataclass(frozen=True)
class Spread:
    """Mean and interval of one delay over several runs.

    Attributes
    ----------
    count : int
        Runs with an estimate.
    mean : float
        Mean of the estimates, s.
    low, high : float
        95 % interval of the mean delay, s: from replayed steps (`replayed`), or from the
        differences between runs (Student's t); NaN where neither exists.
    replayed : bool
        Whether it is from replayed steps; it then includes the error of the method.
    """

    count: int
    mean: float
    low: float
    high: float
    replayed: bool = False

    @property
    def error(self) -> float:
        """The standard error that the interval amounts to, s; NaN without one."""
        return (self.high - self.low) / TWO_SIDED

    @property
    def interval(self) -> str:
        """The interval in words, with how it was found; empty without one."""
        if not math.isfinite(self.low):
            return ""
        how = "corrected by replaying" if self.replayed else "from the spread of the runs"
        return f"{how} {between(self.low, self.high, self.error, 's')}"

    @staticmethod
    def of(values: Sequence[float]) -> Spread:
        """The spread of these delays."""
        from scipy import special

        count = len(values)
        if count == 0:
            return Spread(0, math.nan, math.nan, math.nan)
        mean = float(np.mean(values))
        if count == 1:
            return Spread(1, mean, math.nan, math.nan)
        quantile = float(special.stdtrit(count - 1, 0.975))
        half = quantile * float(np.std(values, ddof=1)) / math.sqrt(count)
        return Spread(count, mean, mean - half, mean + half)
