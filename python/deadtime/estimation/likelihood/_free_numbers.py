"""Numbers of a plant that are fitted around the search of the kernel.

The kernel fits a gain, a delay, lags and a zero. Limits of the rate of a command, complex poles and
named numbers of a plant are not among them. With such numbers given, command and plant are known,
and the rest is searched as always. They are searched around that, in their logarithms, so that each
keeps its sign. Their covariance is the inverse of half the curvature of -2 ln L, minimised over all
else; how the other numbers change with them adds to the variance of these. Both are approximations
by a parabola.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import PlantNumbers
from deadtime.estimation.likelihood._flight import NoiseFit, PlantModel
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rows import FlightRows

#: The plant with such numbers, and the rows under the command that it gets.
Given: TypeAlias = Callable[[Mapping[str, float]], tuple[PlantModel, Sequence[FlightRows]]]

#: The fit with numbers of these logarithms, from another fit.
Fits: TypeAlias = Callable[..., NoiseFit]

#: Distance of the points around the start of the search, in the logarithm of a number; its first
#: step, its accuracy, and the most evaluations for each number.
AWAY, STEP, ACCURACY, MOST = 0.25, 0.05, 1e-3, 40

#: Accuracy of -2 ln L in that search, and at its end.
CLOSE, EXACT = 1e-3, 1e-6

#: Most numbers that are searched so: the points around the start are three to the power of them.
MOST_NUMBERS = 4

#: Curvature in the logarithm of a number from which it is known: one that may be e times as large
#: is not.
LEAST_CURVATURE = 1.0

#: Steps of difference quotients: the first, by which -2 ln L has to rise at least, and the longest.
QUOTIENT, LEAST_RISE, LONGEST = 0.01, 2.0, 0.32


@dataclass(frozen=True, eq=False)
class FreeNumbers:
    """The likeliest numbers.

    Attributes
    ----------
    values : dict of str to float
    cov : ndarray, shape (k, k)
        Covariance of their logarithms.
    slopes : dict of str to ndarray, shape (k,)
        Derivatives of gain, delay, lags, zero and the sum of times by these logarithms.
    """

    values: dict[str, float]
    cov: Array
    slopes: dict[str, Array]

    def added(self, name: str) -> float:
        """The standard deviation that the unknown numbers add to that of a quantity."""
        slope = self.slopes[name]
        return math.sqrt(float(slope @ self.cov @ slope))

    def joined(self, names: Sequence[str], cov: Array) -> Array:
        """Covariance of `names` and the numbers from that of `names` for known ones."""
        slopes = np.array([self.slopes[name] for name in names])
        sizes = np.array(list(self.values.values()))
        cross = slopes @ self.cov * sizes
        return np.block(
            [
                [cov + slopes @ self.cov @ slopes.T, cross],
                [cross.T, self.cov * np.outer(sizes, sizes)],
            ]
        )


@dataclass(frozen=True, eq=False)
class NumbersProfile(LikelihoodProfile):
    """The profile with such numbers free: that for known ones, widened."""

    free: FreeNumbers = field(default_factory=lambda: FreeNumbers({}, np.zeros((0, 0)), {}))

    @property
    def bounds(self) -> dict[str, float]:
        """Standard errors for the fitted noise, also those of these numbers."""
        return self._with_numbers(super().bounds)

    @property
    def stderr(self) -> dict[str, float]:
        """Standard errors for the fitted noise, and for air that may be there unseen."""
        known = super().bounds
        return self._with_numbers(
            {name: one * math.sqrt(self.unseen[name]) for name, one in known.items()}
        )

    def _with_numbers(self, known: Mapping[str, float]) -> dict[str, float]:
        """Standard errors from those for known numbers."""
        found = {name: math.hypot(error, self.free.added(name)) for name, error in known.items()}
        return found | {
            name: abs(value) * math.sqrt(self.free.cov[i, i])
            for i, (name, value) in enumerate(self.free.values.items())
        }

    def freedom_of(self, name: str) -> float:
        """Degrees of freedom of the quantile for a quantity."""
        return self.freedom.get(name, min(self.freedom.values()))

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        if name in self.free.values:
            one = self.free.values[name]
            return (
                (math.log(value / one) * one / self.stderr[name]) ** 2
                if value / one > 0.0
                else np.inf
            )
        known = super().bounds[name] * math.sqrt(self.unseen[name])
        share = known / self.stderr[name]
        return super().statistic(name, value) * share**2

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted value."""
        from scipy import special

        quantile = float(special.stdtrit(self.freedom_of(name), 0.5 + level / 2))
        if name in self.free.values:
            one = self.free.values[name]
            factor = math.exp(quantile * self.stderr[name] / one)
            return min(one / factor, one * factor), max(one / factor, one * factor)
        low, high = super().interval(name, value, stderr, level)
        middle, added = numbers_of(self.fit)[name], quantile * self.free.added(name)
        floor = -math.inf if name == "gain" else 0.0
        return (
            max(floor, middle - math.hypot(middle - low, added)),
            middle + math.hypot(high - middle, added),
        )


def numbers_of(fit: NoiseFit) -> dict[str, float]:
    """Gain, delay, lags, zero and the sum of the times, by the names of an estimate."""
    one = fit.numbers
    lags = dict(zip(fit.model.lag_names, one.lags, strict=True))
    total = one.delay + sum(one.lags) - one.zero + fit.model.own_lag
    return {
        "gain": fit.gain,
        "delay": one.delay,
        "zero": one.zero,
        **lags,
        "delay+lag": total,
        "delay+time_constant": total,
    }


def plant_at(fit: NoiseFit, values: Mapping[str, float]) -> PlantNumbers:
    """The numbers of a fit with other ones in the place of some, by the names of the kernel."""
    one = fit.with_gain
    lags = [values.get(f"lag {i}", lag) for i, lag in enumerate(one.lags)]
    delay, gain, zero = (values.get(name, getattr(one, name)) for name in ("delay", "gain", "zero"))
    return PlantNumbers(delay, lags, one.noise, gain, zero)


def fit_numbers(
    fit: NoiseFit, given: Given, first: Mapping[str, float]
) -> tuple[NoiseFit, FreeNumbers]:
    """The likeliest numbers with plant and noise, from those of `first` with the fit there."""
    names, at = tuple(first), _fits(fit, given, first)
    middle = _likeliest(at, first)
    best = at(middle, fit)
    curvature, slopes = _parabola(at, middle, best)
    sizes, directions = np.linalg.eigh(0.5 * curvature)
    if not np.all(sizes > LEAST_CURVATURE):
        raise NotIdentifiableError(
            f"the {' and '.join(names)} cannot be told from what else is fitted by this recording: "
            "fix one of them, or record larger steps"
        )
    values = _values(first, middle)
    return best, FreeNumbers(values, (directions / sizes) @ directions.T, slopes)


def numbers_under_white_noise(
    fit: NoiseFit, given: Given, first: Mapping[str, float]
) -> tuple[NoiseFit, dict[str, float]]:
    """The fit of least squares, and the numbers under which it is best."""
    at = _fits(fit, given, first, white=True)
    middle = _likeliest(at, first)
    return at(middle, fit), _values(first, middle)


def _values(first: Mapping[str, float], logs: Array) -> dict[str, float]:
    """The numbers with these logarithms, each with its sign."""
    values = np.sign(list(first.values())) * np.exp(logs)
    return dict(zip(first, values.tolist(), strict=True))


def _fits(fit: NoiseFit, given: Given, first: Mapping[str, float], white: bool = False) -> Fits:
    """The function that fits plant and noise, or the plant alone, with numbers given."""

    def at(logs: Array, near: NoiseFit = fit, tolerance: float = EXACT) -> NoiseFit:
        model, rows = given(_values(first, logs))
        return NoiseFit(model, tuple(rows), near.trim, near.numbers).refit(tolerance, white)

    return at


def _likeliest(at: Fits, first: Mapping[str, float]) -> Array:
    """Logarithms of the likeliest numbers, near those of `first`."""
    from scipy.optimize import minimize

    middle = np.log(np.abs(list(first.values())))
    tried: list[NoiseFit] = []

    def objective(logs: Array) -> float:
        # The best so far is near.
        found = at(logs, *tried[-1:], tolerance=CLOSE)
        if not tried or found.numbers.objective < tried[-1].numbers.objective:
            tried.append(found)
        return found.numbers.objective

    around = [middle + np.array(moves) for moves in product((-AWAY, 0.0, AWAY), repeat=len(first))]
    middle = min(around, key=objective)
    # A search that ended in a valley is begun again.
    for _ in range(2):
        corners = np.vstack([middle, middle + STEP * np.eye(middle.size)])
        most = MOST * middle.size
        options: Any = {"initial_simplex": corners, "xatol": ACCURACY, "maxfev": most}
        middle = minimize(objective, middle, method="Nelder-Mead", options=options).x
    return middle


def _parabola(at: Fits, middle: Array, best: NoiseFit) -> tuple[Array, dict[str, Array]]:
    """Second derivatives of -2 ln L, and first ones of the other numbers.

    Where the two sides differ, as where there is air on one side only, the flatter one counts.
    """
    count, base = middle.size, best.numbers.objective
    curvature = np.zeros((count, count))
    slopes = {name: np.zeros(count) for name in numbers_of(best)}
    moves, rises = [], []
    for i in range(count):
        step = QUOTIENT
        while True:
            move = step * np.eye(count)[i]
            higher, lower = at(middle + move, best), at(middle - move, best)
            above, below = (side.numbers.objective - base for side in (higher, lower))
            if min(above, below) > LEAST_RISE or step > LONGEST:
                break
            step *= 2.0
        moves.append(move)
        rises.append(above)
        curvature[i, i] = 2.0 * min(above, below) / step**2
        ahead, behind = numbers_of(higher), numbers_of(lower)
        for name, slope in slopes.items():
            slope[i] = (ahead[name] - behind[name]) / (2.0 * step)
    for i in range(count):
        for j in range(i):
            both = at(middle + moves[i] + moves[j], best).numbers.objective - base
            product_of_steps = moves[i].sum() * moves[j].sum()
            curvature[i, j] = curvature[j, i] = (both - rises[i] - rises[j]) / product_of_steps
    return curvature, slopes
