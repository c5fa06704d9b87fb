"""Loop gain of a sampled loop, cut at the command, on the unit circle.

Between samples the plant moves by matrix exponentials, and the command u_k arrives m samples and
a fraction of one later. With the state x_k of plant, controller and the commands that are under
way within the fraction,

    x_{k+1} = T x_k + b v_k,   u_k = c x_k,   L(z) = -z^(-m) c (z I - T)^(-1) b:

closed by v = u the poles are the zeros of 1 + L. T, b and c are read off the transition matrices
of the loop with its feedback cut and closed (Åström and Wittenmark, Computer-Controlled Systems,
3rd ed. 1997, section 2.3, for the fractional delay). L is exact up to rounding at any frequency up
to pi/Ts; nothing of the hold is approximated. As Ts goes to 0, L(e^(j omega Ts)) goes to the loop
gain of the continuous loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.validation import real_array
from deadtime.loops._model import LoopModel

__all__ = ["SampledLoopGain"]

Vector = NDArray[np.float64]

#: A pole so close to z = 1 stands on it: a double one is computed with the root of the rounding.
_ON_ONE = 1e-6

#: Points from the lowest angle to a half turn in equal ratios and in equal steps, for each half
#: turn of a sample of delay, and around each pole and zero of L on a scale that begins at a quarter
#: of its distance from the circle.
_POINTS = 200
_EVEN = 50
_PER_TURN = 16
_AROUND = 40

#: Peaks of abs(L) lower than this are not looked for: between angles so dense none comes to one.
_LOW_PEAK = 0.3

#: How often the place of a peak of abs(L) is closed in, by a factor of four.
_ZOOMS = 6

#: Most angles at which L is looked at.
_MOST = 4_000_000


@dataclass(frozen=True, eq=False)
class SampledLoopGain:
    """L(z) of a loop with `sample_time` in s; its matrices, and whole samples of delay."""

    T: Vector
    b: Vector
    c: Vector
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

        def matrix(row: Vector, direct: float) -> Vector:
            cut = replace(model, K=row, L=direct)
            return cut.native(part, sample_time).transition_matrix()

        # What drives the plant at the sample is the last state; fed back alone, it shows b.
        T = matrix(none, 0.0)
        b = matrix(none, 1.0)[:, -1] - T[:, -1]
        c = matrix(model.K, float(model.L))[n]
        # In units of states and command that make the matrices small, which changes no L.
        joined = np.block([[T, b[:, None]], [c, np.zeros(1)]])
        with np.errstate(invalid="ignore"):  # units beyond integers, read as places as well
            _, (unit, _) = matrix_balance(joined, permute=False, separate=True)
        unit, own = unit[:-1], unit[-1]
        return cls(T * unit / unit[:, None], b * own / unit, c * unit / own, whole, sample_time)

    def at(self, angle: Vector) -> NDArray[np.complex128]:
        """L(e^(j angle)); infinite at a pole."""
        z = np.exp(1j * angle)
        size = len(self.b)
        # z I - T = (z - 1) I - (T - I), which loses no digits where all of it is close to z = 1.
        matrices = np.expm1(1j * angle)[:, None, None] * np.eye(size) - (self.T - np.eye(size))
        with np.errstate(divide="ignore", invalid="ignore"):
            try:
                states = np.linalg.solve(
                    matrices, np.broadcast_to(self.b[:, None], (len(z), size, 1))
                )
            except np.linalg.LinAlgError:
                return np.concatenate([self._one(m, w) for m, w in zip(matrices, z, strict=True)])
            return np.asarray(-(states[..., 0] @ self.c) * z ** (-self.whole))

    def _one(self, matrix: NDArray[np.complex128], z: complex) -> NDArray[np.complex128]:
        try:
            return np.array([-(self.c @ np.linalg.solve(matrix, self.b)) * z ** (-self.whole)])
        except np.linalg.LinAlgError:
            return np.array([complex(math.inf)])

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Poles of L but those at zero of the whole samples."""
        from scipy.linalg import eigvals

        return np.asarray(eigvals(self.T), dtype=np.complex128)

    @cached_property
    def zeros(self) -> NDArray[np.complex128]:
        """Zeros of L that are finite."""
        from scipy.linalg import eigvals

        size = len(self.b)
        upper = np.column_stack([self.T, self.b])
        pencil = np.vstack([upper, np.append(self.c, 0.0)])
        rest = np.diag(np.append(np.ones(size), 0.0))
        found = cast(Any, eigvals)(pencil, rest, homogeneous_eigvals=True)
        finite = np.abs(found[1]) > 1e-9 * np.abs(found[0])
        return np.asarray(found[0][finite] / found[1][finite], dtype=np.complex128)

    @property
    def integrators(self) -> int:
        """Poles at z = 1."""
        return int(np.count_nonzero(np.abs(self.poles - 1.0) < _ON_ONE))

    @cached_property
    def corners(self) -> Vector:
        """Angles in (0, pi] so close that no pole or zero lies between two, whatever the delay."""
        places = np.concatenate([self.poles, self.zeros])
        away = np.abs(places - 1.0)
        low = 1e-3 * min(1.0 / (self.whole + 1.0), away[away > _ON_ONE].min(initial=1.0))
        while self.integrators and abs(self.at(np.array([low]))[0]) < 1.0 and low > 1e-12:
            low *= 0.01  # below an integrator's crossover
        pieces = [np.geomspace(low, np.pi, _POINTS), np.linspace(low, np.pi, _EVEN)]
        for place in places[places.imag > 0.0]:
            near = max(abs(1.0 - abs(place)), 1e-12)
            reach = np.geomspace(0.25 * near, np.pi, _AROUND)
            pieces += [np.angle(place) - reach, np.angle(place) + reach]
        found = np.unique(np.concatenate(pieces))
        found = found[(found >= low) & (found <= np.pi)]
        return np.unique(np.append(found, self._peaks(found)))

    def _peaks(self, angle: Vector) -> Vector:
        """Where abs(L) is largest, next to those of `angle` at which it is larger than around."""
        sizes = np.abs(self.at(angle))
        highest = 1 + np.flatnonzero((sizes[1:-1] > sizes[:-2]) & (sizes[1:-1] >= sizes[2:]))
        highest = highest[(sizes[highest] > _LOW_PEAK) & np.isfinite(sizes[highest])]
        low, high = angle[highest - 1], angle[highest + 1]
        share = np.linspace(0.0, 1.0, 9)
        rows = np.arange(len(low))
        for _ in range(_ZOOMS):
            inner = low[:, None] + share * (high - low)[:, None]
            sizes = np.abs(self.at(inner.ravel())).reshape(inner.shape)
            best = np.clip(np.argmax(sizes, axis=1), 1, len(share) - 2)
            low, high = inner[rows, best - 1], inner[rows, best + 1]
        return 0.5 * (low + high)

    @cached_property
    def angles(self) -> Vector:
        """`corners` and so many between them that no turn of the delay lies between two."""
        return self._turned(np.full(len(self.corners) - 1, True))

    @cached_property
    def resolved(self) -> Vector:
        """As `angles`, but turns are told apart only where abs(L) may come to one."""
        sizes = np.abs(self.at(self.corners))
        with np.errstate(invalid="ignore"):
            change = np.abs(np.diff(sizes))
            # Peaks are corners, so beyond its ends abs(L) goes by less than it does between them.
            around = np.pad(change, 1)
            reach = np.maximum(sizes[1:], sizes[:-1]) + np.max(
                [around[:-2], change, around[2:]], axis=0
            )
            return self._turned(~(reach < 1.0))

    def _turned(self, chosen: NDArray[np.bool_]) -> Vector:
        """Part the gaps between corners that are `chosen` by the turns of the delay in them."""
        gaps = np.diff(self.corners)
        parts = np.ceil(gaps * (_PER_TURN * (self.whole + 1.0) / np.pi))
        parts = np.where(chosen, np.maximum(parts, 1.0), 1.0)
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

    def frequency_response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """L at frequencies in rad/s from 0 to pi/sample_time."""
        angle = self._angle(omega)
        return self.at(angle.ravel()).reshape(angle.shape)

    def phase(self, omega: ArrayLike) -> Vector:
        """Argument of L in rad, continuous from a quarter turn down for each integrator on."""
        angle = self._angle(omega)
        every = np.unique(np.append(self.angles, angle[angle > 0.0].ravel()))
        turned = np.unwrap(np.angle(self.at(every)))
        start = turned[0]
        if self.integrators:
            wanted = -0.5 * np.pi * self.integrators
            start = wanted + math.remainder(turned[0] - wanted, 2.0 * np.pi)
        return np.asarray(np.interp(angle, every, turned - turned[0] + start))

    def _angle(self, omega: ArrayLike) -> Vector:
        given = real_array("omega", omega) * self.sample_time
        # The half turn itself is asked for in numbers that were divided and multiplied.
        if given.size and not (given.min() >= 0.0 and given.max() <= np.pi * (1.0 + 1e-12)):
            raise ValueError(
                f"omega from {given.min() / self.sample_time:g} to "
                f"{given.max() / self.sample_time:g} rad/s: a loop sampled every "
                f"{self.sample_time:g} s has frequencies from 0 to "
                f"{np.pi / self.sample_time:g} rad/s"
            )
        return np.minimum(given, np.pi)
