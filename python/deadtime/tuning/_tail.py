"""A bound on a response for all times after the end of a simulation.

About its rest a loop is linear until its command meets the limit again. At the end of the
simulation the deviation is a vector z of sizes (the states, and the commands under way), and
whatever follows is bounded by matrices without negative elements:

    abs(z) one period later <= Q abs(z),   abs(output), abs(command) within the period <= R abs(z).

With v = (I - Q)^(-1) abs(z) >= 0 all later abs(z) are at most v, since v = abs(z) + Q v, and the
outputs at most R v (comparison with a positive linear system; Berman and Plemmons 1994, ch. 6).
If R v stays in the band, and the command within its limit, the response has settled for good.
Between grid points, exp(abs(A) h) bounds what states do. Rounding plays no part at these sizes.

For a continuous loop with a delay these follow from its responses to unit states and unit impulses
of its command. With S(t) the responses of all states to unit states, nothing being under way, a
deviation x at time 0 and commands w(t) under way until the delay T give

    x(t) = S(t) x + integral from 0 to T of X(t - s) w(s) ds,
    X(t) = S(t) B + L S(t - T) B + L^2 S(t - 2 T) B + ...,

u = K x + L w. From values on a grid that divides the delay follow bounds on whole cells: within one
of length h states change by at most (exp(abs(A) h) - I) abs(x) and what the commands drive.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import ControlLoop, LoopModel, LoopRun, SampledLoopGain

#: Part of the deviation that may be left after a period; the period is doubled until it is, at most
#: this many times.
_CONTRACTED = 0.6
_DOUBLINGS = 14

#: Points in each part of a sample at which the output is bounded: more give a tighter bound.
_WITHIN = 16

#: Condition number from which on a loop has no unique rest.
_SINGULAR = 1e13

#: Distance of a delay to a whole number of samples, in samples, that counts as rounding.
_ON_SAMPLE = 1e-9

#: Step of a loop without delay, in units of its fastest time constant.
_STEP = 0.25

#: Least number of cells in a delay, cells in the fastest time constant, and most cells in a delay:
#: more cells make the bounds tighter and cost time in proportion.
_CELLS = 8
_FASTEST = 6.0
_MOST_CELLS = 512

#: Upper limit on the number of grid points (bounds memory).
_MOST_POINTS = 400_000


def tail_bound(loop: ControlLoop, amplitude: float, end: float) -> float:
    """Largest deviation of the output from rest at all times after `end`, after a step from zero.

    Infinite where nothing is proved, as where the command may still meet the limit.
    """
    model, delay = loop.specification.model, loop.specification.known_delay
    n = len(model.B)
    matrix = np.block(
        [[model.A, model.B[:, None]], [model.K[None, :], np.array([[model.L - 1.0]])]]
    )
    if np.linalg.cond(matrix) > _SINGULAR:
        return np.inf
    rest = -amplitude * np.linalg.solve(matrix, np.append(model.E, model.M))
    limit = np.inf if loop.limit is None else loop.limit
    if loop.sample_time is not None:
        found = _sampled(loop, rest, limit, end)
    elif delay == 0.0:
        state = states_at(model, 0.0, np.array([end]), np.zeros(n), amplitude, loop.limit)[:, 0]
        found = _without_delay(model, state - rest[:n])
    else:
        known = Fundamental(model, delay)
        found = _with_delay(known, known.sizes_at(amplitude, rest, loop.limit, end))
    output, command = found or (np.inf, np.inf)
    return output if abs(rest[n]) + command <= limit else np.inf


def _later(period: Array, sizes: Array) -> Array | None:
    """Bound on the sizes at the ends of all later periods, which contract."""
    found = np.linalg.solve(np.eye(len(sizes)) - period, sizes)
    holds = np.all(found >= 0.0) and np.all(sizes + period @ found <= found * (1.0 + 1e-9) + 1e-300)
    return np.asarray(found * (1.0 + 1e-6), dtype=np.float64) if holds else None


def _power(Z: Array) -> tuple[Array, int] | None:
    """A power of a matrix whose elements' moduli contract, and which."""
    power = Z
    for doubling in range(_DOUBLINGS):
        if float(np.abs(np.linalg.eigvals(np.abs(power))).max()) < _CONTRACTED:
            return np.abs(power), 2**doubling
        power = power @ power
    return None


def _swept(rows: Array, Z: Array, count: int) -> Array:
    """Largest moduli of the elements of rows Z^k, k below `count`."""
    most = np.abs(rows)
    for _ in range(count - 1):
        rows = rows @ Z
        np.maximum(most, np.abs(rows), out=most)
    return most


def _sampled(
    loop: ControlLoop, rest: Array, limit: float, end: float
) -> tuple[float, float] | None:
    """Of a sampled loop: z are states, the command that is held, and those under way."""
    from scipy.linalg import expm

    model, period = loop.specification.model, cast(float, loop.sample_time)
    delay = loop.specification.known_delay
    whole = math.floor(delay / period + _ON_SAMPLE)
    part = delay - whole * period
    part = part if part > _ON_SAMPLE * period else 0.0
    gain = SampledLoopGain.of(model, part, period)
    T, b, c = gain.T, gain.b, gain.c
    n, N = len(model.B), len(T) + whole
    command, state = rest[n], -rest.copy()
    under_way = [-command] * whole
    for _ in range(int(np.ceil(end / period))):
        under_way.append(max(-limit, min(limit, float(c @ state + command))) - command)
        state = T @ state + b * under_way.pop(0)

    # One sample: the oldest command acts, the newest one goes to the end.
    Z = np.zeros((N, N))
    Z[: n + 1, : n + 1] = T
    newest = np.append(c, np.zeros(whole))
    oldest = np.eye(N)[n + 1] if whole else newest
    Z[: n + 1] += np.outer(b, oldest)
    Z[n + 1 :] = np.vstack([np.eye(N)[n + 2 :], newest[None, :]])[:whole]
    contracted = _power(Z)
    later = contracted and _later(contracted[0], np.abs(np.append(state, under_way)))
    if contracted is None or later is None:
        return None

    # States and acting command up to the arrival of the next command, and from there on.
    held = np.zeros((n + 1, n + 1))
    held[:n, :n], held[:n, n] = model.A, model.B
    now, cells, within = np.eye(n + 1, N), [], []
    for length, acts in ((part, np.eye(N)[n]), (period - part, oldest)):
        now[n] = acts
        step = expm(held * (length / _WITHIN))
        change = expm(np.abs(held) * (length / _WITHIN)) - np.eye(n + 1)
        for _ in range(_WITHIN):
            cells.append(now)
            within.append(change)
            now = step @ now
        now = now.copy()
    output = np.append(model.C, model.D)
    rows = np.vstack([newest, *cells, *(output @ cell for cell in cells)])
    commands, *most = _swept(rows, Z, contracted[1]) @ later
    states = np.reshape(most[: len(cells) * (n + 1)], (len(cells), n + 1))
    drift = np.einsum("j,ijk,ik->i", np.abs(output), np.array(within), states)
    return float((np.array(most[len(cells) * (n + 1) :]) + drift).max()), float(commands)


def _without_delay(model: LoopModel, away: Array) -> tuple[float, float] | None:
    """Of a continuous loop without delay: z are the states, at the ends of short steps."""
    from scipy.linalg import expm

    feedback = model.K / (1.0 - model.L)
    closed = model.A + np.outer(model.B, feedback)
    step = _STEP / max(float(np.abs(np.linalg.eigvals(closed)).max()), 1e-300)
    Z = expm(closed * step)
    contracted = _power(Z)
    later = contracted and _later(contracted[0], np.abs(away))
    if contracted is None or later is None:
        return None
    states = expm(np.abs(closed) * step) @ (_swept(np.eye(len(away)), Z, contracted[1]) @ later)
    output = model.C + model.D * feedback
    return float(np.abs(output) @ states), float(np.abs(feedback) @ states)


def _with_delay(known: Fundamental, sizes: Array | None) -> tuple[float, float] | None:
    """Of a continuous loop: z are the states, and integral and size of the command under way."""
    if sizes is None:
        return None
    for doubling in range(_DOUBLINGS):
        bounds = known.bounds(2**doubling)
        if bounds is None:
            return None
        period, outputs, commands = bounds
        if float(np.abs(np.linalg.eigvals(period)).max()) < _CONTRACTED:
            later = _later(period, sizes)
            return None if later is None else (float(outputs @ later), float(commands @ later))
    return None


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
        self, amplitude: float, rest: Array, limit: float | None, end: float
    ) -> Array | None:
        """abs(x - rest) at `end` or soon after it, and integral and size of what is under way."""
        n, count = len(self.model.B), max(int(np.ceil(end / self.h)), self.cells)
        if count > _MOST_POINTS:
            return None
        times: Array = self.h * np.arange(count + 1, dtype=np.float64)
        states = states_at(self.model, self.delay, times, np.zeros(n), amplitude, limit)
        away = (states - rest[:n, None])[:, None, :]
        # The limit takes commands nearer to that of the rest.
        _, command, _ = self._cells(away, abs(rest[n]))
        late = command[0, -self.cells :]
        return np.array([*np.abs(away[:, 0, -1]), late.sum() * self.h, late.max()])

    def bounds(self, delays: int) -> tuple[Array, Array, Array] | None:
        """Q, and the rows of R for output and command, of a period of `delays` delays."""
        model, cells = self.model, self.cells
        n, count = len(model.B), delays * cells
        if count > _MOST_POINTS // (n + 1):
            return None
        times: Array = self.h * np.arange(count + 1, dtype=np.float64)
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

    def _cells(self, every: Array, before: float) -> tuple[Array, Array, Array]:
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
            flat = x.reshape(len(x), -1)
            drift = (self.within[:, :-1] @ np.abs(flat)).reshape(x.shape)
            drift += self.within[:, -1][:, None, None] * acts
            state[..., part] = np.abs(x) + drift
            for row, direct, bound in (
                (model.K, model.L, command),
                (model.C, model.D, output),
            ):
                bound[:, part] = np.abs(row @ flat).reshape(x.shape[1:])
                bound[:, part] += (np.abs(row) @ drift.reshape(len(x), -1)).reshape(x.shape[1:])
                bound[:, part] += abs(direct) * acts
        return state, command, output

    def _period(
        self, every: Array, size: Array, command: Array, output: Array, delays: int
    ) -> tuple[Array, Array, Array]:
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
    times: Array,
    start: Array,
    amplitude: float,
    limit: float | None,
) -> Array:
    """Every state of a continuous loop after a step, nothing under way at time 0."""
    run = LoopRun(start, command=0.0, reference=amplitude)
    found = [
        model._replace(C=row, D=0.0).native(delay, None, limit).outputs(times, run)
        for row in np.eye(len(model.B))
    ]
    return np.array(found)
