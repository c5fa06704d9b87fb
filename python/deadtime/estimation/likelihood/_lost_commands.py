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
from functools import cached_property, partial
from itertools import product
from typing import ClassVar, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation.likelihood._flight import NoiseFit, changed, with_noise
from deadtime.estimation.likelihood._free_numbers import EXACT, numbers_of, plant_at
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rows import FlightRows

#: The rows of all recordings with the commands that a plant of these numbers leads to.
Refilled: TypeAlias = Callable[[NoiseFit], Sequence[FlightRows]]

#: First steps of the search, in standard errors, before and after the noise is fitted; its most
#: evaluations for each number, and its accuracy in -2 ln L and standard errors.
STEPS, MOST, ACCURACY = (1.0, 0.3), 40, 0.03


#: Most tries of the length over which the curvature is taken, and its length in standard errors:
#: about that of intervals.
WIDER, ENDS = 4, 2.0

#: Factor on standard errors where air, trim or a coloured sensor move the output across the missing
#: rows: without it 87 to 90 % of intervals hold the delay of such flights.
IN_AIR = 1.2

#: The grid of starts: delays in sample times around that of the first fit, and factors of its gain.
DELAYS, GAINS = np.linspace(-1.5, 1.5, 7), np.array([0.85, 1.0, 1.15])


@dataclass(frozen=True, eq=False)
class LostCommandsProfile(LikelihoodProfile):
    """Intervals from the covariance of the numbers that all recordings share."""

    commands_given: ClassVar[bool] = False
    cov: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def common(self) -> Array:
        """Covariance of the common numbers."""
        return self.cov

    @cached_property
    def bounds(self) -> dict[str, float]:
        """Standard errors for the fitted noise."""
        pairs = zip(self.names, np.array(self.native.weights), strict=True)
        return {name: math.sqrt(float(w @ self.cov @ w)) for name, w in pairs}

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        return ((value - numbers_of(self.fit)[name]) / self.stderr[name]) ** 2

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted `value`."""
        from scipy import special

        quantile = float(special.stdtrit(self.freedom[name], 0.5 + level / 2))
        low, high = (value + sign * quantile * self.stderr[name] for sign in (-1.0, 1.0))
        return low if name == "gain" else max(0.0, low), high


def with_lost_commands(
    fit: NoiseFit, refilled: Refilled, sample_time: float
) -> tuple[NoiseFit, Array] | None:
    """The likeliest fit with the commands of its plant, and the covariance of common numbers.

    None where the recording does not tell these numbers apart.
    """
    starts = [fit]
    if not _all_calm(fit):
        calm = [changed(one, air=0.0, sensor=0.0) for one in fit.numbers.noise]
        starts.append(replace(fit, trim=False, numbers=with_noise(fit.with_gain, calm)))
    starts = [_started(one, refilled, sample_time) for one in starts]
    sizes = np.sqrt(np.diag(fit.covariance))
    found = [_searched(one, refilled, sizes) for one in starts]
    best = min(found, key=lambda one: one.criterion)
    cov = _covariance(partial(_objective, best, refilled, sizes), np.zeros(sizes.size))
    sizes = sizes * (1.0 if _all_calm(best) else IN_AIR)
    return None if cov is None else (best, cov * np.outer(sizes, sizes))


def is_calm(fit: NoiseFit, run: int) -> bool:
    """Whether commands and white noise are all that moves the output of a recording."""
    noise = fit.numbers.noise[run]
    return not (fit.trim or noise.air > 0.0 or noise.sensor > 0.0)


def _all_calm(fit: NoiseFit) -> bool:
    return all(is_calm(fit, run) for run in range(len(fit.runs)))


def _started(fit: NoiseFit, refilled: Refilled, sample_time: float) -> NoiseFit:
    """The fit at the likeliest point of a grid over the delay and the gain.

    The likelihood has a maximum of its own in each sample time of the delay.
    """
    now = numbers_of(fit)
    values: list[Array] = []
    for name, kernel in fit.model.order:
        alone = np.array([now[name]])
        tried = {"delay": alone + sample_time * DELAYS, "gain": alone * GAINS}
        values.append(tried.get(kernel, alone))
    points = [np.array(one) for one in product(*values)]
    return min(
        (_with_common(fit, one) for one in points),
        key=lambda one: _minus_log_likelihood(one, refilled),
    )


def _searched(fit: NoiseFit, refilled: Refilled, sizes: Array) -> NoiseFit:
    """The likeliest fit near this one, by steps of such sizes."""
    from scipy import optimize

    for step in STEPS:
        point = optimize.minimize(
            partial(_objective, fit, refilled, sizes),
            np.zeros(sizes.size),
            method="Nelder-Mead",
            options={
                "initial_simplex": np.vstack([np.zeros(sizes.size), step * np.eye(sizes.size)]),
                "xatol": ACCURACY,
                "fatol": ACCURACY,
                "maxfev": MOST * sizes.size,
            },
        ).x
        one = _moved(fit, sizes * point)
        noise = _known(one, refilled).refit(EXACT, white=True).numbers.noise
        fit = one.moved(with_noise(one.with_gain, noise))
    return replace(fit, runs=tuple(refilled(fit)))


def _moved(fit: NoiseFit, by: Array) -> NoiseFit:
    """The fit with its common numbers changed by so much."""
    now = numbers_of(fit)
    return _with_common(fit, np.array([now[name] for name, _ in fit.model.order]) + by)


def _objective(fit: NoiseFit, refilled: Refilled, sizes: Array, point: Array) -> float:
    """-2 ln L around the fit, in these sizes of steps."""
    return _minus_log_likelihood(_moved(fit, sizes * point), refilled)


def _minus_log_likelihood(fit: NoiseFit, refilled: Refilled) -> float:
    """-2 ln L with the commands of this plant."""
    if min(fit.numbers.delay, *fit.numbers.lags, math.inf) < 0.0:
        return math.inf
    return _known(fit, refilled).native.objective(fit.with_gain)


def _known(fit: NoiseFit, refilled: Refilled) -> NoiseFit:
    """The fit with the commands of its plant, of which nothing is free."""
    model, runs = replace(fit.model, names=()), tuple(refilled(fit))
    return replace(fit, model=model, runs=runs, numbers=fit.with_gain)


def _with_common(fit: NoiseFit, values: Array) -> NoiseFit:
    """The fit with other common numbers."""
    kernel = (kernel for _, kernel in fit.model.order)
    moved = plant_at(fit, dict(zip(kernel, values.tolist(), strict=True)))
    return replace(fit, numbers=moved, given_gain=moved.gain)


def _covariance(objective: Callable[[Array], float], point: Array) -> Array | None:
    """The inverse of half the curvature, over about the length of an interval.

    The likelihood has kinks: of two lengths, the one that says less counts.
    """
    scale = np.ones(point.size)
    found: Array | None = None
    for _ in range(WIDER):
        curvature = _curvature(objective, point, scale)
        finite = bool(np.all(np.isfinite(curvature)))
        if finite and np.all(np.linalg.eigvalsh(curvature) > 0.0):
            cov: Array = np.linalg.inv(0.5 * curvature).astype(np.float64)
            if found is not None:
                return cov if np.linalg.det(cov) > np.linalg.det(found) else found
            found, scale = cov, ENDS * np.sqrt(np.diag(cov))
        elif found is not None:
            return found
        else:
            # Where a step leads beyond a bound, such as a lag below zero, shorter ones do not.
            scale = (2.0 if finite else 0.5) * scale
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
