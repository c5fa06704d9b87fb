"""Loop gain of a sampled loop, cut at the command, on the unit circle.

Between samples the state of the plant follows from matrix exponentials, and the command u_k arrives
m samples and a fraction of one later. With the state x_k of plant, controller and the commands in
transit within this fraction,

    x_{k+1} = T x_k + b v_k,   u_k = c x_k,   L(z) = -z^(-m) c (z I - T)^(-1) b:

if the loop is closed by v = u, its poles are the zeros of 1 + L. T, b and c are taken from the
transition matrices of the open and the closed loop (Åström and Wittenmark, Computer-Controlled
Systems, 3rd ed. 1997, section 2.3, for the fractional delay). L is exact up to rounding at any
frequency up to pi/Ts, without any approximation of the hold. As Ts goes to 0, L(e^(j omega Ts))
goes to the loop gain of the continuous loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array, Complex
from deadtime._base.validation import real_array
from deadtime.loops._model import LoopModel

#: A pole this close to z = 1 counts as an integrator: the error of a computed double pole is about
#: the square root of the rounding error.
_ON_ONE = 1e-6

#: A generalised eigenvalue alpha/beta with beta below this fraction of alpha is a zero at infinity.
_AT_INFINITY = 1e-9

#: Lowest angle, as a fraction of the distance from z = 1 to the nearest pole or zero, or of one
#: over the samples of delay: a lower one resolves more and takes more points.
_LOWEST = 1e-3

#: Lower limit of the lowest angle, which is reduced by this factor at a time until it lies below
#: the crossover of a loop with an integrator.
_LEAST_ANGLE = 1e-12
_LOWER_BY = 0.01

#: Numbers of angles: in equal ratios and in equal steps from the lowest one to pi, for each half
#: turn of a sample of delay, and on each side of each pole and zero of L, in equal ratios from
#: _FIRST_AROUND of its distance from the circle, which counts as at least _LEAST_DISTANCE. More
#: resolve narrower resonances and take longer.
_POINTS = 200
_EVEN = 50
_PER_TURN = 16
_AROUND = 40
_FIRST_AROUND = 0.25
_LEAST_DISTANCE = 1e-12

#: Peaks of abs(L) below this at the angles are not refined: with angles this dense, abs(L) does not
#: reach one between them. A smaller one refines more peaks.
_LOW_PEAK = 0.3

#: A peak of abs(L) is enclosed by this many rounds of this many points, each of which makes the
#: interval four times shorter: more rounds give a more accurate peak.
_ZOOMS = 6
_ZOOM_POINTS = 9

#: Upper limit on the number of angles (bounds memory and time).
_MOST = 4_000_000


@dataclass(frozen=True, eq=False)
class SampledLoopGain:
    """L(z) of a loop: T, b and c, the whole samples of delay, and `sample_time` in s."""

    T: Array
    b: Array
    c: Array
    whole: int
    sample_time: float

    @classmethod
    def of(cls, model: LoopModel, delay: float, sample_time: float) -> SampledLoopGain:
        """Cut the loop of `model` at its command."""
        from scipy.linalg import matrix_balance

        whole = math.floor(delay / sample_time)
        part = max(delay - whole * sample_time, 0.0)
        n = len(model.B)
        none = np.zeros_like(model.K)

        def matrix(row: Array, direct: float) -> Array:
            cut = replace(model, K=row, L=direct)
            return cut.native(part, sample_time).transition_matrix()

        # The command is the last state: the change of its column under unit feedback is b.
        T = matrix(none, 0.0)
        b = matrix(none, 1.0)[:, -1] - T[:, -1]
        c = matrix(model.K, float(model.L))[n]
        # Scale states and command so that the matrices are balanced, which does not change L.
        joined = np.block([[T, b[:, None]], [c, np.zeros(1)]])
        with np.errstate(invalid="ignore"):  # scipy converts scales to integers, which may overflow
            _, (unit, _) = matrix_balance(joined, permute=False, separate=True)
        unit, command = unit[:-1], unit[-1]
        T, b, c = T * unit / unit[:, None], b * command / unit, c * unit / command
        return cls(T, b, c, whole, sample_time)

    def at(self, angle: Array) -> Complex:
        """L(e^(j angle)); infinite at a pole."""
        z = np.exp(1j * angle)
        size = len(self.b)
        # z I - T = (z - 1) I - (T - I), which loses no digits if z and the poles are close to 1.
        matrices = np.expm1(1j * angle)[:, None, None] * np.eye(size) - (self.T - np.eye(size))
        with np.errstate(divide="ignore", invalid="ignore"):
            try:
                states = np.linalg.solve(
                    matrices, np.broadcast_to(self.b[:, None], (len(z), size, 1))
                )
            except np.linalg.LinAlgError:
                return np.concatenate([self._one(m, w) for m, w in zip(matrices, z, strict=True)])
            return np.asarray(-(states[..., 0] @ self.c) * z ** (-self.whole))

    def _one(self, matrix: Complex, z: complex) -> Complex:
        try:
            return np.array([-(self.c @ np.linalg.solve(matrix, self.b)) * z ** (-self.whole)])
        except np.linalg.LinAlgError:
            return np.array([complex(math.inf)])

    @cached_property
    def poles(self) -> Complex:
        """Poles of L, except for those at z = 0 that the whole samples of delay add."""
        from scipy.linalg import eigvals

        return np.asarray(eigvals(self.T), dtype=np.complex128)

    @cached_property
    def zeros(self) -> Complex:
        """Finite zeros of L."""
        from scipy.linalg import eigvals

        size = len(self.b)
        upper = np.column_stack([self.T, self.b])
        pencil = np.vstack([upper, np.append(self.c, 0.0)])
        rest = np.diag(np.append(np.ones(size), 0.0))
        found = cast(Any, eigvals)(pencil, rest, homogeneous_eigvals=True)
        finite = np.abs(found[1]) > _AT_INFINITY * np.abs(found[0])
        return np.asarray(found[0][finite] / found[1][finite], dtype=np.complex128)

    @property
    def integrators(self) -> int:
        """Number of poles at z = 1."""
        return int(np.count_nonzero(np.abs(self.poles - 1.0) < _ON_ONE))

    @cached_property
    def corners(self) -> Array:
        """Angles in (0, pi], dense enough to resolve every pole and zero for any delay."""
        places = np.concatenate([self.poles, self.zeros])
        away = np.abs(places - 1.0)
        low = _LOWEST * min(1.0 / (self.whole + 1.0), away[away > _ON_ONE].min(initial=1.0))
        while self.integrators and abs(self.at(np.array([low]))[0]) < 1.0 and low > _LEAST_ANGLE:
            low *= _LOWER_BY
        pieces = [np.geomspace(low, np.pi, _POINTS), np.linspace(low, np.pi, _EVEN)]
        for place in places[places.imag > 0.0]:
            near = max(abs(1.0 - abs(place)), _LEAST_DISTANCE)
            offsets = np.geomspace(_FIRST_AROUND * near, np.pi, _AROUND)
            pieces += [np.angle(place) - offsets, np.angle(place) + offsets]
        found = np.unique(np.concatenate(pieces))
        found = found[(found >= low) & (found <= np.pi)]
        return np.unique(np.append(found, self._peaks(found)))

    def _peaks(self, angle: Array) -> Array:
        """Local maxima of abs(L), each between the neighbours of a largest one of `angle`."""
        sizes = np.abs(self.at(angle))
        highest = 1 + np.flatnonzero((sizes[1:-1] > sizes[:-2]) & (sizes[1:-1] >= sizes[2:]))
        highest = highest[(sizes[highest] > _LOW_PEAK) & np.isfinite(sizes[highest])]
        low, high = angle[highest - 1], angle[highest + 1]
        share = np.linspace(0.0, 1.0, _ZOOM_POINTS)
        rows = np.arange(len(low))
        for _ in range(_ZOOMS):
            inner = low[:, None] + share * (high - low)[:, None]
            sizes = np.abs(self.at(inner.ravel())).reshape(inner.shape)
            best = np.clip(np.argmax(sizes, axis=1), 1, len(share) - 2)
            low, high = inner[rows, best - 1], inner[rows, best + 1]
        return 0.5 * (low + high)

    @cached_property
    def angles(self) -> Array:
        """`corners`, and enough angles between them to resolve every turn due to the delay."""
        gaps = np.diff(self.corners)
        parts = np.ceil(gaps * (_PER_TURN * (self.whole + 1.0) / np.pi))
        if parts.sum() > _MOST:
            raise ValueError(
                f"{self.whole} samples of delay turn the loop gain too often to look at every "
                "turn: take a longer sample_time, or loop.continuous()"
            )
        parts = parts.astype(np.int64)
        first = np.repeat(np.cumsum(parts) - parts, parts)
        share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
        inner = np.repeat(self.corners[:-1], parts) + share * np.repeat(gaps, parts)
        return np.append(inner, self.corners[-1])

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """L at frequencies in rad/s from 0 to pi/sample_time."""
        angle = self._angle(omega)
        return self.at(angle.ravel()).reshape(angle.shape)

    def phase(self, omega: ArrayLike) -> Array:
        """Argument of L in rad, continuous; with n integrators it starts close to -n pi/2."""
        angle = self._angle(omega)
        every = np.unique(np.append(self.angles, angle[angle > 0.0].ravel()))
        turned = np.unwrap(np.angle(self.at(every)))
        start = turned[0]
        if self.integrators:
            expected = -0.5 * np.pi * self.integrators
            start = expected + math.remainder(turned[0] - expected, 2.0 * np.pi)
        return np.asarray(np.interp(angle, every, turned - turned[0] + start))

    def _angle(self, omega: ArrayLike) -> Array:
        given = real_array("omega", omega) * self.sample_time
        # pi/sample_time times sample_time may exceed pi by rounding.
        if given.size and not (given.min() >= 0.0 and given.max() <= np.pi * (1.0 + 1e-12)):
            raise ValueError(
                f"omega from {given.min() / self.sample_time:g} to "
                f"{given.max() / self.sample_time:g} rad/s: a loop sampled every "
                f"{self.sample_time:g} s has frequencies from 0 to "
                f"{np.pi / self.sample_time:g} rad/s"
            )
        return np.minimum(given, np.pi)
