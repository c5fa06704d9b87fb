"""Runs of a height loop in wind whose delay drifts or jumps, made without `deadtime`.

The vehicle is gain / (s (lag s + 1)) behind a delay; gusts of first order enter with the command.
A controller samples the measured output and sends a limited command, which arrives after the delay
of its time. States of plant and gusts move from row to row with their exact joint distribution, for
all runs at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]

#: Sample time of the controller, s, and the bound of its command, m/s.
SAMPLE, LIMIT = 0.065, 1.0


@dataclass(frozen=True)
class Vehicle:
    """The vehicle, its controller and the wind. Units are m and s."""

    gain: float = 0.85
    lag: float = 0.15
    Kp: float = 1.2
    white: float = 0.005
    gust: float = 0.05
    gust_time: float = 1.0


@dataclass(frozen=True)
class Runs:
    """Arrays of shape (runs, rows); `time` of shape (rows,). `delay` is that of each command."""

    vehicle: Vehicle
    time: Array
    reference: Array
    output: Array
    command: Array
    delay: Array


def step_response(age: Array, lag: float) -> tuple[Array, Array]:
    """Speed and height, `age` after a unit step of the command of a vehicle of unit gain."""
    fall = -np.expm1(-age / lag)
    return fall, age - lag * fall


def of_row(vehicle: Vehicle) -> tuple[Array, Array]:
    """Transition of speed, height and gust over a row, and a root of its covariance (Van Loan)."""
    A = np.array(
        [
            [-1.0 / vehicle.lag, 0.0, 1.0 / vehicle.lag],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, -1.0 / vehicle.gust_time],
        ]
    )
    noise = np.zeros((3, 3))
    noise[2, 2] = 2.0 * vehicle.gust**2 / vehicle.gust_time
    both = expm(SAMPLE * np.block([[-A, noise], [np.zeros((3, 3)), A.T]]))
    phi = both[3:, 3:].T
    covariance = phi @ both[:3, 3:]
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return phi, vectors * np.sqrt(np.maximum(values, 0.0))


def references(
    runs: int, rows: int, random: np.random.Generator, hold: float = 0.6, size: float = 0.5
) -> Array:
    """Random signs, held for `hold` s and for up to as long again."""
    found = np.zeros((runs, rows))
    for one in found:
        row = 20
        while row < rows:
            last = row + int(random.uniform(1.0, 2.0) * hold / SAMPLE)
            one[row:last] = size * random.choice([-1.0, 1.0])
            row = last
    return found


def fly(
    vehicle: Vehicle,
    delay: Array,
    reference: Array,
    random: np.random.Generator,
    progress: Callable[[int], None] | None = None,
) -> Runs:
    """Fly all runs. `delay` and `reference` have the shape (runs, rows)."""
    count, rows = reference.shape
    time = SAMPLE * np.arange(rows)
    phi, root = of_row(vehicle)
    state = np.zeros((count, 3))
    state[:, 2] = vehicle.gust * random.standard_normal(count)
    arrivals = np.maximum.accumulate(time + delay, axis=1)
    output, command, jumps = np.zeros((3, count, rows))
    held = np.zeros(count)
    back = int(np.ceil(float(np.max(delay)) / SAMPLE)) + 2
    last = np.zeros(count)
    for k in range(rows):
        if k:
            speed, height = step_response(np.full(1, SAMPLE), vehicle.lag)
            before = vehicle.gain * held
            state = state @ phi.T + random.standard_normal((count, 3)) @ root.T
            state[:, 0] += before * speed
            state[:, 1] += before * height
            low = max(0, k - back)
            age = time[k] - arrivals[:, low:k]
            new = (age >= 0.0) & (age < SAMPLE)
            size = np.where(new, jumps[:, low:k], 0.0)
            speed, height = step_response(np.clip(age, 0.0, SAMPLE), vehicle.lag)
            state[:, 0] += vehicle.gain * np.sum(size * speed, axis=1)
            state[:, 1] += vehicle.gain * np.sum(size * height, axis=1)
            held = held + np.sum(size, axis=1)
        output[:, k] = state[:, 1] + vehicle.white * random.standard_normal(count)
        command[:, k] = np.clip(
            vehicle.Kp * (reference[:, k] - output[:, k]), -LIMIT, LIMIT
        )
        jumps[:, k] = command[:, k] - last
        last = command[:, k]
        if progress is not None and k % 4096 == 0:
            progress(k)
    return Runs(vehicle, time, reference, output, command, delay)


def walks(
    runs: int, rows: int, start: float, end: float, intensity: float, random: np.random.Generator
) -> Array:
    """Random walks of this intensity from `start` to `end` (Brownian bridges), above 0.05 s."""
    steps = intensity * np.sqrt(SAMPLE) * random.standard_normal((runs, rows))
    steps[:, 0] = 0.0
    walk = np.cumsum(steps, axis=1)
    share = np.arange(rows) / (rows - 1)
    bridge = walk - share * walk[:, -1:] + start + share * (end - start)
    return np.maximum(bridge, 0.05)


def arrived(runs: Runs) -> Array:
    """The delay of the command that has arrived last at each row, shape (runs, rows)."""
    arrivals = np.maximum.accumulate(runs.time + runs.delay, axis=1)
    found = np.empty_like(runs.delay)
    for one, times, delays in zip(found, arrivals, runs.delay, strict=True):
        one[:] = delays[np.maximum(np.searchsorted(times, runs.time, side="right") - 1, 0)]
    return found
