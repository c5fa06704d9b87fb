"""Run many loops at once, in fixed parts of a row, each with its own faults.

A command arrives after its delay, unless a later one was there before, and is held until the next.
Within a part its mean is held, and the linear plant is stepped exactly. The controller reads the
sensor at each row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from strangers.faults import Chain, nothing
from strangers.linear import Array, Linear
from strangers.plants import Runs


@dataclass(frozen=True)
class Logs:
    """What is logged of many runs, arrays of shape (runs, rows).

    `gains` has the ends of the factor that the gain went through, shape (runs, 2).
    """

    time: Array
    reference: Array
    output: Array
    command: Array
    gains: Array


def arrivals(
    late: Array, dt: Array, parts: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Rows of the commands held at both ends of each part, and the share of the second.

    Row -1 is what was commanded before the first row.
    """
    runs, rows = late.shape
    sent = np.arange(rows) * dt[:, None]
    at = np.minimum.accumulate((sent + late)[:, ::-1], axis=1)[:, ::-1] / (dt / parts)[:, None]
    edges = np.arange(rows * parts + 1) + 1e-9
    held = np.array([np.searchsorted(one, edges, side="right") - 1 for one in at])
    first, second = held[:, :-1], held[:, 1:]
    padded = np.concatenate([np.zeros((runs, 1)), at], axis=1)
    share = edges[1:] - np.take_along_axis(padded, second + 1, axis=1)
    return first, second, np.clip(np.where(second > first, share, 0.0), 0.0, 1.0)


class Actuator:
    """What the actuator makes of each command, with its memory."""

    def __init__(self, chain: Chain) -> None:
        self.name, self.width = chain.actuator, chain.width
        self.limit = chain.runs.kind.swing
        self.at = np.zeros(len(chain.runs))

    def __call__(self, command: Array) -> Array:
        if self.name == "dead zone":
            return np.sign(command) * np.maximum(np.abs(command) - self.width, 0.0)
        if self.name == "unequal limits":
            return np.maximum(command, self.width - self.limit)
        if self.name == "play":
            half = 0.5 * self.width
            self.at = np.clip(self.at, command - half, command + half)
            return self.at
        if self.name == "stiction":
            self.at = np.where(np.abs(command - self.at) > self.width, command, self.at)
            return self.at
        return command


class Plants:
    """States of the plants, and their steps over a part of a row."""

    def __init__(self, linear: Linear, step: Array) -> None:
        A, B, self.C = linear.space()
        self.speed = np.einsum("ri,rij->rj", self.C, A)
        n = A.shape[1]
        M = np.zeros((len(linear), n + 1, n + 1))
        M[:, :n, :n], M[:, :n, n] = A, B
        E = expm(M * step[:, None, None])
        self.E, self.F = E[:, :n, :n], E[:, :n, n]
        self.x = np.zeros((len(linear), n))

    def move(self, first: Array, second: Array, share: Array) -> None:
        """Step with one command, then with another for this share of the part."""
        command = first + share * (second - first)
        self.x = np.matmul(self.E, self.x[:, :, None])[:, :, 0] + self.F * command[:, None]

    @property
    def output(self) -> Array:
        return np.asarray(np.einsum("ri,ri->r", self.C, self.x))

    @property
    def velocity(self) -> Array:
        return np.asarray(np.einsum("ri,ri->r", self.speed, self.x))


class LimitedPlants:
    """An integrator behind a lag whose output has a largest slope, and behind it a further lag.

    Zeros act on the output.
    """

    def __init__(self, linear: Linear, step: Array) -> None:
        self.gain, self.limit = linear.gain, linear.acceleration
        self.lag, *self.further = linear.lags.T
        self.zero, self.step = linear.zeros.sum(axis=1), step
        self.position, self.wanted, self.velocity = (np.zeros(step.size) for _ in range(3))

    def move(self, first: Array, second: Array, share: Array) -> None:
        """Step with one command, then with another for this share of the part."""
        for command, long in ((first, (1.0 - share) * self.step), (second, share * self.step)):
            change = -np.expm1(-long / self.lag) * (self.gain * command - self.wanted)
            change = np.clip(change, -self.limit * long, self.limit * long)
            way, self.wanted = long * (self.wanted + 0.5 * change), self.wanted + change
            if not self.further:
                self.velocity = self.wanted
            for lag in self.further:
                slope = change / np.maximum(long, np.finfo(float).tiny)
                off = self.velocity - (self.wanted - change) + slope * lag
                last = self.velocity
                self.velocity = self.wanted - slope * lag + off * np.exp(-long / lag)
                way = way - lag * (self.velocity - last)
            self.position = self.position + way

    @property
    def output(self) -> Array:
        return np.asarray(self.position + self.zero * self.velocity)


def plants_of(linear: Linear, step: Array) -> Plants | LimitedPlants:
    """The plants at rest, limited or not."""
    return (LimitedPlants if np.isfinite(linear.acceleration).any() else Plants)(linear, step)


def logged(runs: Runs, chain: Chain | None = None) -> Logs:
    """Run all loops; outputs and commands are those of the log."""
    chain = chain or nothing(runs)
    kind, rows, parts = runs.kind, runs.kind.rows, runs.kind.parts
    first, second, share = arrivals(chain.late, runs.dt, parts)
    plants, actuator = plants_of(runs.linear, runs.dt / parts), Actuator(chain)
    held = np.zeros((len(runs), rows + 1))  # the last column is what was before the first row
    read, command = np.zeros((len(runs), rows)), np.zeros((len(runs), rows))
    gains = np.ones((len(runs), 2))
    total, number = np.zeros(len(runs)), np.arange(len(runs))
    drags, levels = bool(chain.drag.any()), bool(chain.level.any())
    disturbance = runs.noise + chain.added
    for k in range(rows):
        fresh = plants.output + disturbance[:, k]
        read[:, k] = np.where(chain.stale[:, k], read[:, k - 1], fresh) if k else fresh
        command[:, k], total = _controlled(runs, k, read[:, k], total)
        held[:, k] = actuator(command[:, k])
        for part in range(k * parts, (k + 1) * parts):
            factor, added = chain.gain[:, part], chain.load[:, part]
            if levels:
                factor = factor * (1.0 + chain.level * plants.output)
            if drags:
                velocity = plants.output if kind.filtered else plants.velocity
                added = added - chain.drag * velocity * np.abs(velocity)
            gains[:, 0] = np.minimum(gains[:, 0], factor)
            gains[:, 1] = np.maximum(gains[:, 1], factor)
            before, after = (held[number, at[:, part]] for at in (first, second))
            plants.move(factor * before + added, factor * after + added, share[:, part])
    time = np.arange(rows) * runs.dt[:, None]
    return _as_logged(chain, time, read, command, gains)


def _controlled(runs: Runs, row: int, read: Array, total: Array) -> tuple[Array, Array]:
    """Change of the command from the start, and the integral of the error."""
    kind = runs.kind
    if kind.controller == "open":
        return runs.reference[:, row] - kind.at[0], total
    error = runs.reference[:, row] - kind.at[1] - read
    wanted = runs.Kp * error + runs.Ki * total
    command = np.clip(wanted, -kind.limit, kind.limit)
    if kind.controller == "PI":
        total = np.where(wanted == command, total + runs.dt * error, total)
    return command, total


def _as_logged(chain: Chain, time: Array, read: Array, command: Array, gains: Array) -> Logs:
    """The log of what happened, from the start of command and output."""
    runs, kind = chain.runs, chain.runs.kind
    if chain.smoothed.any():
        read = np.array([mean(one, by) for one, by in zip(read, chain.smoothed, strict=True)])
    if chain.shifted:
        before = np.zeros((len(runs), chain.shifted))
        command = np.concatenate([before, command[:, : -chain.shifted]], axis=1)
    return Logs(time, runs.reference, read + kind.at[1], command + kind.at[0], gains)


def mean(values: Array, wider: float) -> Array:
    """The moving mean of one row and so many more, half of them later; ends are repeated."""
    half = int(np.ceil(0.5 * wider))
    weight = np.clip(0.5 * (1.0 + wider) - (np.abs(np.arange(-half, half + 1)) - 0.5), 0.0, 1.0)
    return np.asarray(np.convolve(np.pad(values, half, "edge"), weight / weight.sum(), "valid"))


def replayed(linear: Linear, changes: Array, dt: Array, parts: int) -> Array:
    """Output of the plants behind their limits, for commands that change so at each row."""
    held = np.concatenate([np.cumsum(changes, axis=1), np.zeros((len(linear), 1))], axis=1)
    rows = changes.shape[1]
    late = np.repeat(linear.delay[:, None], rows, axis=1)
    first, second, share = arrivals(late, dt, parts)
    before, after = (np.take_along_axis(held, at, axis=1) for at in (first, second))
    plants, output = plants_of(linear, dt / parts), np.zeros((len(linear), rows))
    for k in range(rows):
        output[:, k] = plants.output
        for part in range(k * parts, (k + 1) * parts):
            plants.move(before[:, part], after[:, part], share[:, part])
    return output
