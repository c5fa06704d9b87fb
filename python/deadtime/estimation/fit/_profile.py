"""Profile likelihood: the increase of the cost when one parameter is held.

For white Gaussian noise of unknown size, (cost(value) - best)/(best/freedom) is distributed as
the square of Student's t where the model is nearly linear, and the interval holds all values for
which it stays below the quantile squared (Bates & Watts 1988, section 6.1). Where residuals are
coloured, the quantile is widened by the ratio of robust and plain standard errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Profile", "floor_of"]

Array = NDArray[np.float64]

#: Farthest end of an interval, in multiples of the Gaussian one.
FARTHEST = 64.0

#: Accuracy of the ends, in standard errors.
TOLERANCE = 1e-3

#: The search starts at this multiple of the Gaussian interval, so that most ends are bracketed at
#: once.
FIRST_STEP = 1.05


def floor_of(name: str) -> float:
    """Lower bound of a quantity: zero for times, none for gains and clock offsets."""
    return -np.inf if name in ("gain", "start") else 0.0


@dataclass(frozen=True, eq=False)
class Profile:
    """The profile of the cost of one fit.

    Attributes
    ----------
    cost : callable
        Least sum of squares with the named quantity held at a value.
    best : float
        The least sum of squares.
    freedom : int
        Samples less fitted parameters.
    widening : dict of str to float
        Ratio of robust to plain standard error of each quantity.
    preferred : str
        Why the profile interval is preferred to the Gaussian one; empty where it is not.
    """

    cost: Callable[[str, float], float]
    best: float
    freedom: int
    widening: Mapping[str, float]
    preferred: str = ""

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        increase = max(0.0, self.cost(name, value) - self.best)
        scale = self.best / self.freedom
        widening = self.widening.get(name, 1.0)
        return increase / (scale * widening**2) if scale > 0.0 else float(np.inf) * (increase > 0.0)

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted `value`, no lower than `floor_of` allows."""
        from scipy import special

        quantile = float(special.stdtrit(self.freedom, 0.5 + level / 2))
        floor = floor_of(name)
        reach = max(stderr, 1e-9 * abs(value), 1e-12)
        return self._end(name, value, -reach, quantile, floor), self._end(
            name, value, reach, quantile, floor
        )

    def _end(self, name: str, value: float, reach: float, quantile: float, floor: float) -> float:
        # In t itself, which is nearly linear, so that the root search converges quickly.
        from scipy.optimize import brentq

        def excess(offset: float) -> float:
            return float(np.sqrt(self.statistic(name, value + offset)) - quantile)

        inner, factor = 0.0, FIRST_STEP * quantile
        if excess(inner) > 0.0:  # the best fit is exact to rounding
            return value
        while factor <= FARTHEST:
            outer = reach * factor
            if value + outer <= floor:
                if excess(floor - value) <= 0.0:
                    return floor
                outer = floor - value
            if excess(outer) > 0.0:
                return value + float(brentq(excess, inner, outer, xtol=TOLERANCE * abs(reach)))
            inner, factor = outer, 2.0 * factor
        return value + inner
