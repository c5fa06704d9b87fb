"""Commands in missing rows, as functions of the plant.

Where rows are missing, the commands follow from the controller's law and from the output that the
plant predicts there. So they depend on gain, delay and lags, and a response to them tells of these
numbers. The kernel takes commands as given: the numbers of the plant are searched around it, with
the commands of each. Their covariance is the inverse of half the curvature of -2 ln L, and
intervals are t standard errors wide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._deadtime import PlantNumbers
from deadtime.estimation.likelihood._free_numbers import numbers_of
from deadtime.estimation.likelihood._profile import (
    LikelihoodProfile,
    common_covariance,
    unseen_air,
)
from deadtime.estimation.likelihood._rows import FlightRows
from deadtime.estimation.likelihood._search import NoiseFit

Array = NDArray[np.float64]

#: The rows of all recordings with the commands that a plant of these numbers leads to.
Refilled: TypeAlias = Callable[[NoiseFit], Sequence[FlightRows]]

#: First steps of the search, in standard errors, before and after the noise is fitted; its most
#: evaluations for each number, and its accuracy in -2 ln L and standard errors.
STEPS, MOST, ACCURACY = (1.0, 0.3), 40, 0.03


#: Most tries of the length over which the curvature is taken, and its length in standard errors:
#: about that of intervals.
WIDER, ENDS = 4, 2.0

#: Factor on standard errors for kinks of the likelihood that the curvature does not show, where at
#: least so many samples in a row are missing: without it 90 to 93 % of intervals hold the delay of
#: a flight with a hole of a second, with it 95 %. Rows lost one by one need none (98 %).
KINKS, MANY = 1.2, 5


@dataclass(frozen=True, eq=False)
class LostCommandsProfile(LikelihoodProfile):
    """Intervals from the covariance of the numbers that all recordings share."""

    commands_given: ClassVar[bool] = False
    cov: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __reduce__(self) -> tuple[object, ...]:
        return LostCommandsProfile, (self.fit, self.names, self.preferred, self._ends, self.cov)

    @property
    def common(self) -> Array:
        """Covariance of the common numbers."""
        return self.cov

    @cached_property
    def unseen(self) -> dict[str, float]:
        """As where the commands are given."""
        given = common_covariance(self.fit)
        errors = {name: math.sqrt(float(w @ given @ w)) for name, w in self._weights.items()}
        return unseen_air(self.fit, self._weights, errors)

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        return ((value - numbers_of(self.fit)[name]) / self.stderr[name]) ** 2

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted `value`."""
        return self._from_curvature(name, value, level)


def with_lost_commands(
    fit: NoiseFit, refilled: Refilled, longest: int
) -> tuple[NoiseFit, Array] | None:
    """The likeliest fit with the commands of its plant, and the covariance of common numbers.

    At most `longest` samples in a row are missing. None where the recording does not tell these
    numbers apart.
    """
    from scipy import optimize

    start = np.array([numbers_of(fit)[name] for name, _ in fit.model.order])
    sizes = np.sqrt(np.diag(common_covariance(fit)))
    known = replace(fit.model, names=())

    def at(point: Array) -> NoiseFit:
        return _with_common(fit, start + sizes * point)

    def objective(point: Array) -> float:
        one = at(point)
        if min(one.numbers.delay, *one.numbers.lags, math.inf) < 0.0:
            return math.inf
        return known.likelihood(refilled(one), fit.trim).objective(one.with_gain)

    point = np.zeros(start.size)
    for step in STEPS:
        corners = np.vstack([point, point + step * np.eye(point.size)])
        point = optimize.minimize(
            objective,
            point,
            method="Nelder-Mead",
            options={
                "initial_simplex": corners,
                "xatol": ACCURACY,
                "fatol": ACCURACY,
                "maxfev": MOST * point.size,
            },
        ).x
        one = at(point)
        found = known.likelihood(refilled(one), fit.trim).fit(one.with_gain)
        fit = one.moved(
            PlantNumbers(
                one.numbers.delay, one.numbers.lags, found.noise, one.gain, one.numbers.zero
            )
        )
    cov = _covariance(objective, point)
    if cov is None:
        return None
    kinks = KINKS if longest >= MANY else 1.0
    return replace(fit, runs=tuple(refilled(fit))), kinks**2 * cov * np.outer(sizes, sizes)


def _with_common(fit: NoiseFit, values: Array) -> NoiseFit:
    """The fit with other common numbers."""
    one = fit.numbers
    kernel = dict(zip((kernel for _, kernel in fit.model.order), values.tolist(), strict=True))
    lags = [kernel.get(f"lag {i}", lag) for i, lag in enumerate(one.lags)]
    delay, zero = kernel.get("delay", one.delay), kernel.get("zero", one.zero)
    gain = kernel.get("gain", fit.gain)
    return replace(fit, numbers=PlantNumbers(delay, lags, one.noise, gain, zero), given_gain=gain)


def _covariance(objective: Callable[[Array], float], point: Array) -> Array | None:
    """The inverse of half the curvature, over about the length of an interval.

    The likelihood has kinks: of two lengths, the one that says less counts.
    """
    scale = np.ones(point.size)
    found: Array | None = None
    for _ in range(WIDER):
        curvature = _curvature(objective, point, scale)
        if np.all(np.linalg.eigvalsh(curvature) > 0.0):
            cov: Array = np.linalg.inv(0.5 * curvature).astype(np.float64)
            if found is not None:
                return cov if np.linalg.det(cov) > np.linalg.det(found) else found
            found, scale = cov, ENDS * np.sqrt(np.diag(cov))
        elif found is not None:
            return found
        else:
            scale = 2.0 * scale
    return found


def _curvature(objective: Callable[[Array], float], point: Array, scale: Array) -> Array:
    """Second derivatives around a minimum, by steps of such lengths."""
    count, least = point.size, objective(point)
    steps = np.diag(scale)
    sides = [objective(point + step) + objective(point - step) for step in steps]
    found = np.diag(np.array(sides) - 2.0 * least)
    for i in range(count):
        for j in range(i):
            alike, unlike = (
                objective(point + steps[i] + way * steps[j])
                + objective(point - steps[i] - way * steps[j])
                for way in (1.0, -1.0)
            )
            found[i, j] = found[j, i] = 0.25 * (alike - unlike)
    return found / np.outer(scale, scale)
