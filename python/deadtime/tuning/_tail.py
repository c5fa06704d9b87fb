"""A bound on a response for all times after the end of a simulation.

About its rest a loop is linear until its command meets the limit again. At the end of the
simulation the deviation is a vector z of sizes (the states, and the commands under way), and
whatever follows is bounded by matrices without negative elements:

    abs(z) one period later <= Q abs(z),   abs(output), abs(command) within the period <= R abs(z).

With v = (I - Q)^(-1) abs(z) >= 0 all later abs(z) are at most v, since v = abs(z) + Q v, and the
outputs at most R v (comparison with a positive linear system; Berman and Plemmons 1994, ch. 6).
If R v stays in the band, and the command within its limit, the response has settled for good.
Between grid points, exp(abs(A) h) bounds what states do. Rounding plays no part at these sizes.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from numpy.typing import NDArray

from deadtime.loops import ControlLoop
from deadtime.loops._model import LoopModel
from deadtime.loops._sampled_gain import SampledLoopGain
from deadtime.tuning._fundamental import Fundamental, states_at

Vector = NDArray[np.float64]

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


def _later(period: Vector, sizes: Vector) -> Vector | None:
    """Bound on the sizes at the ends of all later periods; None where they may grow."""
    if float(np.abs(np.linalg.eigvals(period)).max()) >= 1.0:
        return None
    found = np.linalg.solve(np.eye(len(sizes)) - period, sizes)
    holds = np.all(found >= 0.0) and np.all(sizes + period @ found <= found * (1.0 + 1e-9) + 1e-300)
    return np.asarray(found * (1.0 + 1e-6), dtype=np.float64) if holds else None


def _power(Z: Vector) -> tuple[Vector, int] | None:
    """A power of a matrix whose elements' moduli contract, and which."""
    power = Z
    for doubling in range(_DOUBLINGS):
        if float(np.abs(np.linalg.eigvals(np.abs(power))).max()) < _CONTRACTED:
            return np.abs(power), 2**doubling
        power = power @ power
    return None


def _swept(rows: Vector, Z: Vector, count: int) -> Vector:
    """Largest moduli of the elements of rows Z^k, k below `count`."""
    most = np.abs(rows)
    for _ in range(count - 1):
        rows = rows @ Z
        np.maximum(most, np.abs(rows), out=most)
    return most


def _sampled(
    loop: ControlLoop, rest: Vector, limit: float, end: float
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
        under_way.append(float(np.clip(c @ state + command, -limit, limit) - command))
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


def _without_delay(model: LoopModel, away: Vector) -> tuple[float, float] | None:
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


def _with_delay(known: Fundamental, sizes: Vector | None) -> tuple[float, float] | None:
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
