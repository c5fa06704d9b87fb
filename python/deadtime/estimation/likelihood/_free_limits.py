"""Limits of the rate of a command that are fitted beside plant and noise.

For given limits the command that the plant gets is known, and plant and noise are searched as
always. The limits are searched around that, in their logarithms. Their covariance is the inverse of
half the curvature of -2 ln L, minimised over all else; how the other numbers change with them adds
to the variance of these. Both are approximations by a parabola.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rows import FlightRows
from deadtime.estimation.likelihood._search import NoiseFit, airs_of, with_noise

Array = NDArray[np.float64]

#: Rows under the command within some limits.
RowsWithin = Callable[[Mapping[str, float]], Sequence[FlightRows]]

#: Distance of the points around the start of the search, in the logarithm of a limit; its first
#: step, its accuracy, and the most evaluations.
AWAY, STEP, ACCURACY, MOST = 0.25, 0.05, 1e-3, 60

#: Curvature in the logarithm of a limit from which it is known: one that may be e times as large is
#: not.
LEAST_CURVATURE = 1.0

#: Steps of difference quotients: the first, by which -2 ln L has to rise at least, and the longest.
QUOTIENT, LEAST_RISE, LONGEST = 0.01, 2.0, 0.32


@dataclass(frozen=True, eq=False)
class FreeLimits:
    """The likeliest limits.

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
        """The standard deviation that the unknown limits add to that of a quantity."""
        slope = self.slopes[name]
        return math.sqrt(float(slope @ self.cov @ slope))

    def joined(self, names: Sequence[str], cov: Array) -> Array:
        """Covariance of `names` and the limits from that of `names` for known limits."""
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
class LimitsProfile(LikelihoodProfile):
    """The profile with free limits: that for known ones, widened."""

    limits: FreeLimits = field(default_factory=lambda: FreeLimits({}, np.zeros((0, 0)), {}))

    def __reduce__(self) -> tuple[object, ...]:
        return LimitsProfile, (self.fit, self.names, self.preferred, self._ends, self.limits)

    @property
    def stderr(self) -> dict[str, float]:
        """Standard errors, also those of the limits."""
        known = super().stderr
        found = {name: math.hypot(error, self.limits.added(name)) for name, error in known.items()}
        return found | {
            name: value * math.sqrt(self.limits.cov[i, i])
            for i, (name, value) in enumerate(self.limits.values.items())
        }

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        if name in self.limits.values:
            one = self.limits.values[name]
            return (math.log(value / one) * one / self.stderr[name]) ** 2 if value > 0.0 else np.inf
        share = super().stderr[name] / self.stderr[name]
        return super().statistic(name, value) * share**2

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted value."""
        from scipy import special

        freedom = self.freedom.get(name, min(self.freedom.values()))
        quantile = float(special.stdtrit(freedom, 0.5 + level / 2))
        if name in self.limits.values:
            one = self.limits.values[name]
            factor = math.exp(quantile * self.stderr[name] / one)
            return one / factor, one * factor
        low, high = super().interval(name, value, stderr, level)
        middle, added = numbers_of(self.fit)[name], quantile * self.limits.added(name)
        floor = -math.inf if name == "gain" else 0.0
        return (
            max(floor, middle - math.hypot(middle - low, added)),
            middle + math.hypot(high - middle, added),
        )


def numbers_of(fit: NoiseFit) -> dict[str, float]:
    """Gain, delay, lags, zero and the sum of the times, by the names of an estimate."""
    one = fit.numbers
    lags = dict(zip(fit.model.lag_names, one.lags, strict=True))
    total = one.delay + sum(one.lags)
    return {
        "gain": fit.gain,
        "delay": one.delay,
        "zero": one.zero,
        **lags,
        "delay+lag": total,
        "delay+time_constant": total,
    }


def fit_limits(
    fit: NoiseFit, rows_within: RowsWithin, first: Mapping[str, float]
) -> tuple[NoiseFit, FreeLimits]:
    """The likeliest limits with plant and noise, from those of `first` with the fit there."""
    from scipy.optimize import minimize

    names = tuple(first)

    def at(logs: Array, near: NoiseFit = fit) -> NoiseFit:
        rows = tuple(rows_within(dict(zip(names, np.exp(logs).tolist(), strict=True))))
        likelihood = near.model.likelihood(rows, near.trim)
        starts = [near.numbers]
        if any(noise.air == 0.0 for noise in near.numbers.noise):
            # Without air there is none after a search either.
            starts.append(with_noise(near.numbers, airs_of(near.model, rows)[1]))
        found = min((likelihood.fit(one) for one in starts), key=lambda one: one.objective)
        return NoiseFit(near.model, rows, near.trim, found)

    middle = np.log([first[name] for name in names])

    def objective(logs: Array) -> float:
        return at(logs).numbers.objective

    around = [middle + np.array(moves) for moves in product((-AWAY, 0.0, AWAY), repeat=len(names))]
    middle = min(around, key=objective)
    # A search that ended in a valley is begun again.
    for _ in range(2):
        corners = np.vstack([middle, middle + STEP * np.eye(middle.size)])
        options: Any = {"initial_simplex": corners, "xatol": ACCURACY, "maxfev": MOST}
        middle = minimize(objective, middle, method="Nelder-Mead", options=options).x
    best = at(middle)
    curvature, slopes = _parabola(at, middle, best)
    sizes, directions = np.linalg.eigh(0.5 * curvature)
    if not np.all(sizes > LEAST_CURVATURE):
        raise NotIdentifiableError(
            f"the {' and '.join(names)} cannot be told from delay and lags by this recording: fix "
            "them, or record larger steps"
        )
    values = dict(zip(names, np.exp(middle).tolist(), strict=True))
    return best, FreeLimits(values, (directions / sizes) @ directions.T, slopes)


def _parabola(
    at: Callable[..., NoiseFit], middle: Array, best: NoiseFit
) -> tuple[Array, dict[str, Array]]:
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
