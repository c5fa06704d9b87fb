"""The Cramér-Rao bound of what can be learnt of a rate loop from its log.

The mean of the response, given the commands that were logged, depends on delay, gain and motor lag,
and on the constant torque and on rate and motors at the first row, which are not known either. Its
derivatives are whitened by the Kalman filter of the gusts and of the gyro's noise behind its
low-pass. That covariance depends on none of these parameters, so the bound is the same whether
gusts and noise are known or not. Noise acts in the loop through the command alone, which is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np

from rate_loops.generator import (
    DIGITS,
    FILTERED,
    GUST,
    GUSTS,
    MOTORS,
    RATE,
    Array,
    Log,
    Vehicle,
    arrivals,
    held,
    memory,
    read,
    reading_noise,
    stepped,
)

#: What is unknown, and the step of each for central differences.
STEPS = {"delay": 1e-6, "gain": 1e-3, "lag": 1e-6, "trim": 1e-3, "rate": 1e-3, "motors": 1e-3}

#: Those that are the vehicle's and decide what the loop does.
PLANT = ("delay", "gain", "lag")


def covariance(log: Log) -> Array:
    """Least covariance of the estimates of `PLANT`."""
    slopes = []
    for name, step in STEPS.items():
        up, down = (mean(log, {name: way * step}) for way in (1.0, -1.0))
        slopes.append((up - down) / (2.0 * step))
    J = whitened(log.vehicle, np.stack(slopes, axis=1))
    size = len(PLANT)
    return np.asarray(np.linalg.inv(J.T @ J)[:size, :size])


def deviation_of_sum(covered: Array) -> float:
    """Least standard deviation of delay + lag, s."""
    weight = np.array([float(name in ("delay", "lag")) for name in PLANT])
    return math.sqrt(weight @ covered @ weight)


def deviation_of(quantity: Callable[[Vehicle], float], vehicle: Vehicle, covered: Array) -> float:
    """Least standard deviation of something that the plant decides."""
    slopes = []
    for name in PLANT:
        step = 1e-2 * getattr(vehicle, name)
        ends = [replace(vehicle, **{name: getattr(vehicle, name) + w * step}) for w in (1.0, -1.0)]
        slopes.append((quantity(ends[0]) - quantity(ends[1])) / (2.0 * step))
    slope = np.array(slopes)
    return math.sqrt(slope @ covered @ slope)


def mean(log: Log, changed: dict[str, float]) -> Array:
    """Response to the logged commands, without noise, after a first row at rest."""
    known = {one.name for one in fields(Vehicle)}
    own = {name: getattr(log.vehicle, name) + by for name, by in changed.items() if name in known}
    vehicle = replace(log.vehicle, **own)
    A = stepped(vehicle)[0]
    whole, before, after = arrivals(vehicle)
    sent = np.concatenate([np.full(whole + 1, log.actuator[0]), log.actuator])
    trim = vehicle.trim * read(vehicle, held(vehicle, RATE))
    state = np.zeros(len(A))
    state[RATE] = changed.get("rate", 0.0)
    state[FILTERED:] = state[RATE] * settled(vehicle.order)
    state[MOTORS] = vehicle.gain * log.actuator[0] + changed.get("motors", 0.0)
    inputs = np.outer(sent[:-1], before) + np.outer(sent[1:], after) + trim
    found = np.empty(log.time.size)
    for k in range(found.size):
        found[k] = state[FILTERED]
        state = A @ state + inputs[k]
    return found


def whitened(vehicle: Vehicle, columns: Array) -> Array:
    """Innovations of columns of the response, in their standard deviations."""
    A, Q = stepped(vehicle)
    size = len(A)
    covered = np.zeros((size, size))
    covered[GUSTS, GUSTS] = GUST**2
    inner = slice(FILTERED, size)
    kept, b = memory(vehicle.order)
    covered[inner, inner] = stationary(kept, reading_noise(vehicle.order) ** 2 * np.outer(b, b))
    state, found = np.zeros((size, columns.shape[1])), np.empty_like(columns)
    for k, row in enumerate(columns):
        variance = covered[FILTERED, FILTERED] + DIGITS**2
        gain = covered[:, FILTERED] / variance
        innovation = row - state[FILTERED]
        found[k] = innovation / math.sqrt(variance)
        state = A @ (state + np.outer(gain, innovation))
        covered = A @ (covered - np.outer(gain, covered[FILTERED])) @ A.T + Q
    return found


def settled(order: int) -> Array:
    """States of the low-pass that has long read one."""
    A, b = memory(order)
    return np.linalg.solve(np.eye(b.size) - A, b)


def stationary(A: Array, Q: Array) -> Array:
    """P = A P A' + Q."""
    size = len(A)
    return np.linalg.solve(np.eye(size**2) - np.kron(A, A), Q.ravel()).reshape(size, size)
