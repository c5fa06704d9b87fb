"""Linear plants, many at once: response, gain, equivalent delay and largest stable gain.

G(s) = k (1 + z s) ... / (s^n (L s + 1) ... (s²/ω² + 2 ζ s/ω + 1)) e^(-T s), one in each run. A zero
belongs to the pair of poles, else to the lags in their order, so that each part is proper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import expm

Array = NDArray[np.float64]

#: Frequencies at which the phase is looked at, and decades around 1 / (sum of all times).
PLACES, DECADES = 1200, 3.0


@dataclass(frozen=True)
class Linear:
    """Numbers of the plants: `gain` and `delay` have shape (runs,), the others (runs, number).

    `pairs` has frequency and damping in turn. `acceleration` is the largest slope of the output of
    the lags before the integrator, infinite where nothing limits it.
    """

    gain: Array
    delay: Array
    lags: Array
    zeros: Array
    pairs: Array
    integrators: int
    acceleration: Array

    def __len__(self) -> int:
        return int(self.gain.size)

    def of(self, rows: NDArray[np.intp] | slice) -> Linear:
        """Some of the runs, also several times."""
        names = ("gain", "delay", "lags", "zeros", "pairs", "acceleration")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def repeated(self, times: int) -> Linear:
        """All runs, so many times one after the other."""
        return self.of(np.tile(np.arange(len(self)), times))

    @property
    def without_limit(self) -> Linear:
        """The same where nothing limits the acceleration."""
        return replace(self, acceleration=np.full(len(self), np.inf))

    def response(self, omega: Array) -> tuple[Array, Array]:
        """ln |G| and the angle without its jumps, without that of integrators; omega (runs, n)."""
        w = omega
        size = np.log(np.abs(self.gain))[:, None] - self.integrators * np.log(w)
        angle = -w * self.delay[:, None]
        for lag in self.lags.T[:, :, None]:
            size, angle = size - 0.5 * np.log1p((lag * w) ** 2), angle - np.arctan(lag * w)
        for zero in self.zeros.T[:, :, None]:
            size, angle = size + 0.5 * np.log1p((zero * w) ** 2), angle + np.arctan(zero * w)
        for i in range(0, self.pairs.shape[1], 2):
            x = w / self.pairs[:, i, None]
            real, imaginary = 1.0 - x * x, 2.0 * self.pairs[:, i + 1, None] * x
            size = size - np.log(np.hypot(real, imaginary))
            angle = angle - np.arctan2(imaginary, real)
        return size, angle

    def at(self, omega: Array) -> tuple[Array, Array]:
        """ln |G| and the equivalent delay, one frequency for each run."""
        size, angle = self.response(omega[:, None])
        return size[:, 0], -angle[:, 0] / omega

    @property
    def _time(self) -> Array:
        pairs = (1.0 / self.pairs[:, ::2]).sum(axis=1)
        whole = self.delay + self.lags.sum(axis=1) + np.abs(self.zeros).sum(axis=1) + pairs
        return np.asarray(np.maximum(whole, np.finfo(float).tiny))

    def turns(self) -> tuple[Array, Array]:
        """Frequency at which the largest stable gain oscillates, and the logarithm of this gain."""
        exponents = np.linspace(-DECADES, DECADES, PLACES)
        w = 10.0**exponents / self._time[:, None]
        size, angle = self.response(w)
        turn = (angle - 0.5 * np.pi * self.integrators + np.pi) / (2.0 * np.pi)
        passes = np.floor(turn[:, 1:]) != np.floor(turn[:, :-1])
        least = np.where(passes, -np.maximum(size[:, 1:], size[:, :-1]), np.inf).argmin(axis=1)
        run = np.arange(len(self))
        low, high = w[run, least], w[run, least + 1]
        whole = np.maximum(np.floor(turn[run, least]), np.floor(turn[run, least + 1]))
        goal = whole * 2.0 * np.pi + 0.5 * np.pi * self.integrators - np.pi
        falling = turn[run, least] > turn[run, least + 1]
        for _ in range(40):
            middle = np.sqrt(low * high)
            before = (self.response(middle[:, None])[1][:, 0] > goal) == falling
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        found = np.where(passes[run, least], np.sqrt(low * high), np.nan)
        return found, -self.at(found)[0]

    def crossover(self) -> Array:
        """Highest frequency below the turn where half of the largest gain crosses over.

        Half of the turn where it does not.
        """
        turn, largest = self.turns()
        w = turn[:, None] * 10.0 ** np.linspace(0.0, -DECADES, PLACES)
        above = self.response(w)[0] >= (np.log(2.0) - largest)[:, None]
        place, run = above.argmax(axis=1), np.arange(len(self))
        high, low = w[run, place - 1], w[run, place]
        for _ in range(40):
            middle = np.sqrt(low * high)
            under = self.at(middle)[0] < np.log(2.0) - largest
            high, low = np.where(under, middle, high), np.where(under, low, middle)
        return np.where(above.any(axis=1), low, 0.5 * turn)

    def felt(self, omega: Array) -> Array:
        """ln gain and equivalent delay at a frequency, and ln of the largest gain; (runs, 3)."""
        return np.stack([*self.at(omega), self.turns()[1]], axis=1)

    def space(self) -> tuple[Array, Array, Array]:
        """A, B and C of the plants without their delay."""
        parts = self._parts()
        A, B, C, D = parts[0]
        for a, b, c, d in parts[1:]:
            n, m = A.shape[1], a.shape[1]
            whole = np.zeros((len(self), n + m, n + m))
            whole[:, :n, :n], whole[:, n:, n:] = A, a
            whole[:, n:, :n] = b[:, :, None] * C[:, None, :]
            B = np.concatenate([B, b * D[:, None]], axis=1)
            C = np.concatenate([d[:, None] * C, c], axis=1)
            A, D = whole, D * d
        return A, B * self.gain[:, None], C

    def _parts(self) -> list[tuple[Array, Array, Array, Array]]:
        """A, B, C, D of the factors, from the command to the output."""
        runs, parts = len(self), []
        one, none = np.ones((runs, 1)), np.zeros(runs)
        zeros = list(self.zeros.T)
        for i in range(0, self.pairs.shape[1], 2):
            w, damping = self.pairs[:, i], self.pairs[:, i + 1]
            zero = zeros.pop(0) if zeros else none
            A = np.zeros((runs, 2, 2))
            A[:, 0, 1], A[:, 1, 0], A[:, 1, 1] = w, -w, -2.0 * damping * w
            C = np.stack([np.ones(runs), zero * w], axis=1)
            parts.append((A, np.stack([none, w], axis=1), C, none))
        for lag in self.lags.T:
            zero = zeros.pop(0) if zeros else none
            A, B = (-1.0 / lag)[:, None, None], (1.0 / lag)[:, None]
            parts.append((A, B, (1.0 - zero / lag)[:, None], zero / lag))
        for _ in range(self.integrators):
            parts.append((np.zeros((runs, 1, 1)), one, one, none))
        return parts

    def step_response(self, dt: Array, rows: int) -> tuple[Array, NDArray[np.intp]]:
        """Output of a unit step at each row from the first that it moves, and that row."""
        A, B, C = self.space()
        n = A.shape[1]
        M = np.zeros((len(self), n + 1, n + 1))
        M[:, :n, :n], M[:, :n, n] = A, B
        late = np.ceil(self.delay / dt)
        first = expm(M * (late * dt - self.delay)[:, None, None])[:, :, n:]
        states, power = first, expm(M * dt[:, None, None])
        while states.shape[2] < rows:
            states = np.concatenate([states, power @ states], axis=2)
            power = power @ power
        return np.einsum("ri,rik->rk", C, states[:, :n, :rows]), late.astype(np.intp)

    def outputs(self, changes: Array, dt: Array) -> Array:
        """Output of the commands that change so at each row, from rest; no limit acts.

        Parameters
        ----------
        changes : ndarray, shape (runs, rows)
        """
        rows = changes.shape[1]
        response, late = self.step_response(dt, rows)
        place = np.arange(rows) - late[:, None]
        moved = np.take_along_axis(response, np.maximum(place, 0), axis=1) * (place >= 0)
        size = next_fast_len(2 * rows)
        return np.asarray(irfft(rfft(moved, size) * rfft(changes, size), size)[:, :rows])


def joined(parts: Sequence[Linear]) -> Linear:
    """All runs of several."""
    names = ("gain", "delay", "lags", "zeros", "pairs", "acceleration")
    return replace(
        parts[0], **{name: np.concatenate([getattr(one, name) for one in parts]) for name in names}
    )
