"""Profile likelihood: the increase of the cost when one parameter is held.

For white Gaussian noise of unknown size, (cost(value) - best)/(best/freedom) is distributed as
the square of Student's t where the model is nearly linear, and the interval holds all values for
which it stays below the quantile squared (Bates & Watts 1988, section 6.1). Where residuals are
coloured, the quantile is widened by the ratio of robust and plain standard errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

import deadtime.estimation._native as native
from deadtime.estimation.fit._least_squares import Minimum, Model

#: Farthest end of an interval, in multiples of the Gaussian one.
FARTHEST = 64.0

#: Accuracy of the ends, in standard errors.
TOLERANCE = 1e-3

#: The search starts at this multiple of the Gaussian interval, so that most ends are bracketed at
#: once.
FIRST_STEP = 1.05


#: Beginnings of the names of times that are not negative, and units of other quantities. Further
#: ones have the unit that their plant gives them.
TIMES = ("delay", "lag", "time_constant")
UNITS = {"zero": "s", "start": "s", "pole_frequency": "rad/s"}

#: Further quantities that are not negative.
POSITIVE = ("limit", "rate", "rate_of_rate", "pole_frequency", "pole_damping")


def floor_of(name: str) -> float:
    """Lower bound of a quantity: zero for times, none for gains and clock offsets."""
    return 0.0 if name.startswith(TIMES) or name in POSITIVE else -np.inf


def unit_of(name: str) -> str:
    """Unit of a quantity; empty where it depends on the units of command and output."""
    return "s" if name.startswith(TIMES) else UNITS.get(name, "")


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

    def freedom_of(self, name: str) -> float:
        """Degrees of freedom of the quantile for a quantity."""
        return float(self.freedom)

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
        reach = max(stderr, 1e-9 * abs(value), 1e-12)

        def excess(end: float) -> float:
            # At the best fit itself the search for the others may end a little above it.
            rise = self.statistic(name, end) if end != value else 0.0
            return math.sqrt(rise) - quantile  # nearly linear, as the square is not

        step, floor = FIRST_STEP * quantile * reach, floor_of(name)
        low, high = (
            native.interval_end(excess, value, way, floor, FARTHEST * reach, TOLERANCE * reach)
            for way in (-step, step)
        )
        return low, high


def least_cost(
    model: Model, best: Minimum, known: Mapping[str, float], name: str, value: float
) -> float:
    """Least sum of squares with `name`, a parameter or a sum, at `value`, the others free.

    `known` holds the parameters that were not fitted, which may be part of a sum.
    """
    return model.problem.least_held(best, *places_of(name, value, model, known))


def places_of(
    name: str, value: float, model: Model, known: Mapping[str, float]
) -> tuple[list[int], float]:
    """Places of the parameters in a sum, and what they add up to where the sum is `value`.

    `known` holds the parameters that are not moved.
    """
    parts, labels = name.split("+"), model.labels
    value -= sum(known.get(part, 0.0) for part in parts if part not in labels)
    return [labels.index(part) for part in parts if part in labels], value
