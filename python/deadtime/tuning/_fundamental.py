"""Responses of a continuous loop with a delay to unit states and unit impulses of its command.

With S(t) the responses of all states to unit states, nothing being under way, a deviation x at
time 0 and commands w(t) under way until the delay T give

    x(t) = S(t) x + integral from 0 to T of X(t - s) w(s) ds,
    X(t) = S(t) B + L S(t - T) B + L^2 S(t - 2 T) B + ...,

u = K x + L w. From values on a grid that divides the delay follow bounds on whole cells: within one
of length h states change by at most (exp(abs(A) h) - I) abs(x) and what the commands drive.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deadtime.loops._model import LoopModel, LoopRun

Vector = NDArray[np.float64]

#: Least number of cells in a delay, cells in the fastest time constant, and most cells in a delay:
#: more cells make the bounds tighter and cost time in proportion.
_CELLS = 8
_FASTEST = 6.0
_MOST_CELLS = 512

#: Upper limit on the number of grid points (bounds memory).
_MOST_POINTS = 400_000


class Fundamental:
    """The unit responses of one loop, simulated as far as they are asked for."""

    def __init__(self, model: LoopModel, delay: float) -> None:
        from scipy.linalg import expm

        self.model, self.delay = model, delay
        n = len(model.B)
        undelayed = model.A + np.outer(model.B, model.K)
        rates = [np.abs(np.linalg.eigvals(one)).max(initial=0.0) for one in (model.A, undelayed)]
        self.cells = int(np.clip(np.ceil(_FASTEST * max(rates) * delay), _CELLS, _MOST_CELLS))
        self.h = float(delay / self.cells)
        held = np.zeros((n + 1, n + 1))
        held[:n, :n], held[:n, n] = np.abs(model.A), np.abs(model.B)
        #: Change within a cell, per unit of the states at its beginning and of the command in it.
        self.within = (expm(held * self.h) - np.eye(n + 1))[:n]

    def sizes_at(
        self, amplitude: float, rest: Vector, limit: float | None, end: float
    ) -> Vector | None:
        """abs(x - rest) at `end` or soon after it, and integral and size of what is under way."""
        n, count = len(self.model.B), max(int(np.ceil(end / self.h)), self.cells)
        if count > _MOST_POINTS:
            return None
        times: Vector = self.h * np.arange(count + 1, dtype=np.float64)
        states = states_at(self.model, self.delay, times, np.zeros(n), amplitude, limit)
        away = (states - rest[:n, None])[:, None, :]
        # The limit takes commands nearer to that of the rest.
        _, command, _ = self._cells(away, abs(rest[n]))
        late = command[0, -self.cells :]
        return np.array([*np.abs(away[:, 0, -1]), late.sum() * self.h, late.max()])

    def bounds(self, delays: int) -> tuple[Vector, Vector, Vector] | None:
        """Q, and the rows of R for output and command, of a period of `delays` delays."""
        model, cells = self.model, self.cells
        n, count = len(model.B), delays * cells
        if count > _MOST_POINTS // (n + 1):
            return None
        times: Vector = self.h * np.arange(count + 1, dtype=np.float64)
        unit = [states_at(model, self.delay, times, start, 0.0, None) for start in np.eye(n)]
        states = np.array(unit).transpose(1, 0, 2)  # state, start, time
        driven = np.einsum("ijk,j->ik", states, model.B)[:, None, :]
        for echo in range(1, delays + 1):
            late = echo * cells
            if model.L == 0.0:
                break
            driven[:, 0, late:] += model.L**echo * np.einsum(
                "ijk,j->ik", states[..., : count + 1 - late], model.B
            )
        every = np.concatenate([states, driven], axis=1)  # state, start or impulse, time
        return self._period(every, *self._cells(every, 0.0), delays)

    def _cells(self, every: Vector, before: float) -> tuple[Vector, Vector, Vector]:
        """Bounds on each cell of states, command and output, of the responses in `every`.

        `before` bounds the command that is under way at first.
        """
        model, cells = self.model, self.cells
        count = every.shape[-1] - 1
        starts = every[..., :-1]
        state = np.empty_like(starts)
        command, output = np.empty(starts.shape[1:]), np.empty(starts.shape[1:])
        for first in range(0, count, cells):
            part = slice(first, first + cells)
            x = starts[..., part]
            acts = np.full(x.shape[1:], before)
            if first:
                acts = command[:, first - cells : first][:, : x.shape[-1]]
            drift = np.einsum("ij,jkl->ikl", self.within[:, :-1], np.abs(x))
            drift += self.within[:, -1][:, None, None] * acts
            state[..., part] = np.abs(x) + drift
            for row, direct, bound in (
                (model.K, model.L, command),
                (model.C, model.D, output),
            ):
                bound[:, part] = np.abs(np.tensordot(row, x, axes=1))
                bound[:, part] += np.tensordot(np.abs(row), drift, axes=1)
                bound[:, part] += abs(direct) * acts
        return state, command, output

    def _period(
        self, every: Vector, size: Vector, command: Vector, output: Vector, delays: int
    ) -> tuple[Vector, Vector, Vector]:
        model, cells, h = self.model, self.cells, self.h
        n, L = len(model.B), abs(model.L)
        last = slice(-cells, None)
        longer = slice(-2 * cells, None)
        Q = np.zeros((n + 2, n + 2))
        Q[:n, :n] = np.abs(every[:, :n, -1])
        # An impulse comes at any time within the delay.
        Q[:n, n] = size[:, n, last].max(axis=-1)
        echo = L**delays
        Q[n, :n] = command[:n, last].sum(axis=-1) * h
        summed = np.convolve(command[n, longer], np.ones(cells + 1))
        Q[n, n] = summed.max() * h + echo
        Q[n + 1, :n] = command[:n, last].max(axis=-1)
        Q[n + 1, n] = command[n, longer].max()
        Q[n + 1, n + 1] = echo
        outputs = np.concatenate([output.max(axis=-1), [abs(model.D)]])
        commands = np.concatenate([command.max(axis=-1), [L]])
        return Q, outputs, commands


def states_at(
    model: LoopModel,
    delay: float,
    times: Vector,
    start: Vector,
    amplitude: float,
    limit: float | None,
) -> Vector:
    """Every state of a continuous loop after a step, nothing under way at time 0."""
    run = LoopRun(start, command=0.0, reference=amplitude)
    found = [
        replace(model, C=row, D=0.0).native(delay, None, limit).outputs(times, run)
        for row in np.eye(len(model.B))
    ]
    return np.array(found)
