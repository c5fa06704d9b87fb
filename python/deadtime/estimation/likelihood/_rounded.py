"""The likelihood of an output that is rounded: each row tells an interval, not a value.

A row that reads r, rounded to steps of q, tells that output and noise together were within q/2 of r
(Gjeddebæk 1949):

    P = Φ((r + q/2 - m)/σ) - Φ((r - q/2 - m)/σ),

m the output of the plant, σ the deviation of white noise before the rounding. Where the noise is
smaller than a step, rows at which the reading changes tell far more than a rounding error of q/√12
would, and rows that stay on a step rule out the plants that would have left it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array, Indices, Mask
from deadtime.estimation.fit._directions import Directions, all_directions, held_directions
from deadtime.estimation.fit._least_squares import Model

#: The noise at which searches begin, in steps: with the first the likelihood is smooth.
NOISES = (0.5, 0.15)

#: Least and largest noise, in steps: below the least, rows are intervals with hard ends.
LEAST, MOST = 0.02, 3.0

#: Sizes of the parameters in a search, in their standard errors by least squares, and its accuracy
#: in -2 ln L as a share of it.
SIZE, ACCURATE = 0.3, 1e-10

#: Readings around the most probable one over which the information of a row is summed.
READINGS = np.arange(-12.0, 13.0)

#: Probability of a reading below which it tells nothing.
IMPOSSIBLE = 1e-30

#: Distance of a reading from the output, in deviations, from which the slope no longer grows.
FARTHEST = 1e4


class Peak(NamedTuple):
    """The least -2 ln L, the parameters of the plant, and the logarithms of the noise."""

    value: float
    point: Array
    logs: Array


@dataclass(frozen=True, eq=False)
class RoundedLikelihood:
    """-2 ln L of rounded rows, over the parameters of a plant and the noise of each recording.

    Attributes
    ----------
    model : Model
        The plant, without weights.
    output : ndarray, shape (n,)
        Readings of all recordings, one after the other.
    steps : ndarray, shape (recordings,)
        To which each recording is rounded.
    recording : ndarray of int, shape (n,)
        Which recording each row is of.
    used : ndarray of bool, shape (n,)
    errors : ndarray, shape (p,)
        Standard errors of the parameters by least squares.
    """

    model: Model
    output: Array
    steps: Array
    recording: Indices
    used: Mask
    errors: Array

    def likeliest(self, start: Array) -> Peak:
        """The lowest minimum from a start, from much noise and from little."""
        space = all_directions(start.size)
        found = [
            self._minimum(Peak(math.inf, start, np.log(noise * self.steps)), space)
            for noise in NOISES
        ]
        best = min(found, key=lambda one: one.value)
        return self._minimum(best, space)

    def held(self, peak: Peak, names: list[str], value: float, known: Mapping[str, float]) -> float:
        """The least -2 ln L with the sum of some parameters held."""
        space = held_directions(self.model, peak.point, names, value, known)
        starts = [peak, peak._replace(logs=np.log(NOISES[0] * self.steps))]
        return min(self._minimum(start, space).value for start in starts)

    def _minimum(self, start: Peak, space: Directions) -> Peak:
        """Search over the noise and the points of a space."""
        from scipy.optimize import minimize

        base, free = space.base, space.free
        low, high = space.bounds(self.model)
        scale = np.append(SIZE * self.errors[space.moving], np.ones(start.logs.size))
        low = np.append(low, np.log(LEAST * self.steps))
        high = np.append(high, np.log(MOST * self.steps))
        count = free.shape[1]

        def cost(z: Array) -> tuple[float, Array]:
            q, logs = np.split(z * scale, [count])
            value, by_mean, by_logs = self.at(base + free @ q, logs)
            jacobian = self.model.jacobian(base + free @ q) @ free
            return value, np.append(by_mean @ jacobian, by_logs) * scale

        found = minimize(
            cost,
            np.clip(np.append(start.point[space.moving], start.logs), low, high) / scale,
            jac=True,
            method="L-BFGS-B",
            bounds=np.stack([low, high], axis=1) / scale[:, None],
            options={"ftol": ACCURATE, "gtol": 1e-5, "maxiter": 300},
        )
        q, logs = np.split(found.x * scale, [count])
        return Peak(float(found.fun), base + free @ q, logs)

    @cached_property
    def _half(self) -> Array:
        return 0.5 * self.steps[self.recording]

    def at(self, point: Array, logs: Array) -> tuple[float, Array, Array]:
        """-2 ln L, its derivatives by the mean of each row, and by the logarithms of the noise."""
        from scipy import special

        away = -self.model.misfit(point)
        deviation = np.exp(logs)[self.recording]
        # Of both signs that of the smaller probabilities, whose logarithms are exact.
        sizes, half = np.minimum(np.abs(away) / deviation, FARTHEST), self._half / deviation
        low, high = -sizes - half, -sizes + half
        upper = special.log_ndtr(high)
        log = upper + np.log1p(-np.exp(special.log_ndtr(low) - upper))
        at_low, at_high = (
            np.exp(-0.5 * z**2 - log) / math.sqrt(2.0 * math.pi) for z in (low, high)
        )
        by_mean = -2.0 * self.used * np.sign(away) * (at_high - at_low) / deviation
        by_log = 2.0 * self.used * (high * at_high - low * at_low)
        by_logs = np.bincount(self.recording, by_log, minlength=logs.size)
        return -2.0 * float(log @ self.used), by_mean, np.asarray(by_logs, dtype=np.float64)

    def covariance(self, peak: Peak) -> Array:
        """Inverse of Fisher's information of the parameters, the noise unknown too."""
        jacobian = self.model.jacobian(peak.point)
        of_mean, mixed, of_noise = self._information_of_rows(peak)
        own = np.eye(peak.logs.size)[self.recording]
        cross = jacobian.T @ (mixed[:, None] * own)
        noise = own.T @ (of_noise[:, None] * own)
        total = jacobian.T @ (of_mean[:, None] * jacobian)
        total -= cross @ np.linalg.pinv(noise, hermitian=True) @ cross.T
        return np.asarray(np.linalg.pinv(total, hermitian=True))

    def _information_of_rows(self, peak: Peak) -> tuple[Array, Array, Array]:
        """Information of each row about its mean, mean and noise, and the logarithm of the noise.

        Its readings have probabilities P; the information is the sum of (dP)²/P over them.
        """
        from scipy import special

        deviation = np.exp(peak.logs)[self.recording][:, None]
        step = 2.0 * self._half[:, None]
        mean = (self.model.misfit(peak.point) + self.output)[:, None]
        # Steps lie around the readings.
        nearest = self.output[:, None] + step * np.rint((mean - self.output[:, None]) / step)
        away = nearest + step * READINGS - mean
        low, high = (away - 0.5 * step) / deviation, (away + 0.5 * step) / deviation
        P = special.ndtr(high) - special.ndtr(low)
        share = np.where(P > IMPOSSIBLE, 1.0 / np.maximum(P, IMPOSSIBLE), 0.0)
        at_low, at_high = (np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi) for z in (low, high))
        by_mean, by_log = (at_low - at_high) / deviation, low * at_low - high * at_high
        pairs = ((by_mean, by_mean), (by_mean, by_log), (by_log, by_log))
        of_mean, mixed, of_noise = (self.used * np.sum(a * b * share, axis=1) for a, b in pairs)
        return of_mean, mixed, of_noise


@dataclass(frozen=True)
class RoundedCost:
    """-2 ln L with one quantity held, as the cost of a `Profile` whose variance is one."""

    likelihood: RoundedLikelihood
    peak: Peak
    known: Mapping[str, float]
    freedom: int

    def __call__(self, name: str, value: float) -> float:
        """The rise, on top of what a sum of squares has at its least."""
        least = self.likelihood.held(self.peak, name.split("+"), value, self.known)
        return self.freedom + max(0.0, least - self.peak.value)
