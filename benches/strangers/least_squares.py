"""Fit a plant of known structure to a response, many at once, by Gauss and Newton's method.

Free are gain, delay, lags, zeros, pairs of poles but that of a known filter, the limit of the
acceleration where there is one, and the output at the start. Steps are damped as Levenberg and
Marquardt do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from strangers.linear import Array, Linear, joined
from strangers.plants import Kind
from strangers.simulate import replayed

#: Step of the derivatives, and steps of a fit.
STEP, ROUNDS = 1e-5, 15

#: Runs that are fitted at once, by their rows.
AT_ONCE = 60_000


def vector(linear: Linear, kind: Kind) -> Array:
    """The free numbers, (runs, number): logarithms of those above zero, and shares of a delay."""
    pairs = linear.pairs[:, :-2] if kind.filtered else linear.pairs
    unit = kind.numbers["delay"][0]
    columns = [np.log(np.abs(linear.gain))[:, None], linear.delay[:, None] / unit]
    columns += [np.log(linear.lags), linear.zeros / unit, np.log(pairs)]
    if np.isfinite(linear.acceleration).all():
        columns.append(np.log(linear.acceleration)[:, None])
    return np.concatenate(columns, axis=1)


def of_vector(numbers: Array, start: Linear, kind: Kind) -> Linear:
    """The plants with these free numbers; the rest is that of the start."""
    unit, lags, zeros = kind.numbers["delay"][0], start.lags.shape[1], start.zeros.shape[1]
    ends = np.cumsum([1, 1, lags, zeros, start.pairs.shape[1] - 2 * kind.filtered])
    gain, delay, lag, zero, pair, rest = np.split(numbers, ends, axis=1)
    pairs = np.exp(pair)
    if kind.filtered:
        pairs = np.concatenate([pairs, start.pairs[:, -2:]], axis=1)
    acceleration = np.exp(rest[:, 0]) if rest.shape[1] else start.acceleration
    return Linear(
        np.sign(start.gain) * np.exp(gain[:, 0]),
        np.maximum(delay[:, 0] * unit, 0.0),
        np.exp(lag),
        zero * unit,
        pairs,
        start.integrators,
        acceleration,
    )


@dataclass(frozen=True)
class Data:
    """What is fitted: changes of the command from the start, and outputs, both (runs, rows)."""

    kind: Kind
    dt: Array
    changes: Array
    outputs: Array

    def of(self, rows: slice) -> Data:
        return replace(
            self, dt=self.dt[rows], changes=self.changes[rows], outputs=self.outputs[rows]
        )


def data_of(kind: Kind, dt: Array, command: Array, output: Array) -> Data:
    """What was logged, as it is fitted."""
    changes = np.diff(command, axis=1, prepend=kind.at[0])
    return Data(kind, dt, changes, output)


def response(linear: Linear, data: Data) -> Array:
    """Output of these plants, less its mean; several for each run, one after the other."""
    times = len(linear) // data.dt.size
    changes, dt = np.tile(data.changes, (times, 1)), np.tile(data.dt, times)
    if np.isfinite(linear.acceleration).any():
        found = replayed(linear, changes, dt, data.kind.parts)
    else:
        found = linear.outputs(changes, dt)
    return np.asarray(found - found.mean(axis=1, keepdims=True))


def slopes(of: Callable[[Array], Array], at: Array) -> tuple[Array, Array]:
    """Values of a function of (runs, p) numbers, and its derivatives (runs, values, p)."""
    p = at.shape[1]
    steps = STEP * np.concatenate([np.zeros((1, p)), np.eye(p)])
    some = at[None] + steps[:, None, :]
    values = of(some.reshape(-1, p)).reshape(p + 1, at.shape[0], -1)
    return values[0], np.moveaxis(values[1:] - values[0], 0, 2) / STEP


def fitted(start: Linear, data: Data) -> Linear:
    """The plants whose responses are nearest to the outputs, from a start."""
    size = max(1, AT_ONCE // data.changes.shape[1])
    if len(start) > size:
        parts = [slice(i, i + size) for i in range(0, len(start), size)]
        return joined([fitted(start.of(part), data.of(part)) for part in parts])
    kind, goal = data.kind, data.outputs - data.outputs.mean(axis=1, keepdims=True)
    at, damping = vector(start, kind), np.full(len(start), 1e-3)

    def outputs(numbers: Array) -> Array:
        times = numbers.shape[0] // len(start)
        return response(of_vector(numbers, start.repeated(times), kind), data)

    for _ in range(ROUNDS):
        values, J = slopes(outputs, at)
        rest = goal - values
        normal = np.einsum("rki,rkj->rij", J, J)
        right = np.einsum("rki,rk->ri", J, rest)
        scale = np.einsum("rii->ri", normal) + 1e-300
        damped = normal + (damping[:, None] * scale)[:, :, None] * np.eye(at.shape[1])
        unit = np.sqrt(scale)
        step = np.linalg.solve(
            damped / unit[:, :, None] / unit[:, None, :], (right / unit)[..., None]
        )
        next_one = at + np.clip(step[..., 0] / unit, -0.5, 0.5)
        better = ((goal - outputs(next_one)) ** 2).sum(axis=1) < (rest**2).sum(axis=1)
        at = np.where(better[:, None], next_one, at)
        damping = np.where(better, damping / 10.0, damping * 10.0)
    return of_vector(at, start, kind)


def standard_errors(linear: Linear, data: Data, deviation: Array, omega: Array) -> Array:
    """Errors of ln gain, equivalent delay and ln of the largest gain by white noise; (runs, 3).

    They are those of the numbers at the true plant, in the Gauss-Newton approximation.
    """
    kind, at = data.kind, vector(linear, data.kind)

    def plants(numbers: Array) -> Linear:
        return of_vector(numbers, linear.repeated(numbers.shape[0] // len(linear)), kind)

    def felt(numbers: Array) -> Array:
        times = numbers.shape[0] // len(linear)
        return plants(numbers).felt(np.tile(omega, times))

    J = slopes(lambda numbers: response(plants(numbers), data), at)[1]
    gradient = slopes(felt, at)[1]
    unit = np.sqrt(np.einsum("rki,rki->ri", J, J))
    inverse = np.linalg.pinv(np.einsum("rki,rkj->rij", J, J) / unit[:, :, None] / unit[:, None, :])
    scaled = gradient / unit[:, None, :]
    variance = np.einsum("rqi,rij,rqj->rq", scaled, inverse, scaled)
    return np.asarray(deviation[:, None] * np.sqrt(variance))
