"""Recordings of a height loop, made without `deadtime`, so that they are independent of it.

The vehicle is gain / (s (lag s + 1)) behind a delay. The controller samples the measured output,
noise included, and sends a limited command, which the vehicle holds from its arrival to that of the
next. The plant is linear, so the output is a sum of two parts: the response to the jumps of the
command, in closed form, and that to the air, whose velocity is drawn exactly at sixteen points a
sample time and taken as linear between them.

Where the delay changes, the true delay is that of the rows that decide it, as least squares on a
record without noise weighs them: a delay has an effect only where the command changes.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from reality.conditions import CORRELATED, LIMIT, SAMPLE, Condition

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Points a sample time at which the velocity of the air is drawn.
POINTS = 16


@dataclass(frozen=True)
class Vehicle:
    """The truth of one run: SI units; `lags` without those that are zero."""

    delay: float
    gain: float
    lags: tuple[float, ...]
    Kp: float
    step: float


@dataclass(frozen=True)
class Run:
    """Everything that happened in one run. Arrays have a value for each sample of the controller.

    Attributes
    ----------
    vehicle : Vehicle
        The truth. Where the delay changes, its delay is that of the rows that decide it.
    times, arrivals : ndarray
        True times of the samples, and those at which their commands reach the vehicle, s.
    stamps : ndarray
        What the log says of the times.
    reference, path, measured, command : ndarray
        The path is the true output, from the zero of the sensor. The command is as the
        controller sent it.
    logged, outlying : ndarray of bool
        Rows that are in the log, and those whose measurement is an outlier.
    """

    vehicle: Vehicle
    times: Array
    arrivals: Array
    stamps: Array
    reference: Array
    path: Array
    measured: Array
    command: Array
    logged: Mask
    outlying: Mask


def ramp(age: Array, lags: Sequence[float | Array]) -> Array:
    """Response of 1 / (s (L1 s + 1) (L2 s + 1) ...) to a unit step, `age` after it.

    The lags must differ from each other.
    """
    age = np.maximum(age, 0.0)
    found = age.copy()
    for i, lag in enumerate(lags):
        share = math.prod(lag / (lag - other) for j, other in enumerate(lags) if j != i)
        found += lag * share * np.expm1(-age / lag)
    return found


def drawn_vehicle(condition: Condition, random: np.random.Generator) -> Vehicle:
    """A vehicle, and a controller with which its loop is stable and well damped."""
    delay, gain = random.uniform(0.15, 0.45), random.uniform(0.6, 1.1)
    lag = random.uniform(0.05, 0.25)
    lags = (lag if condition.lag else 0.0, condition.second_lag)
    Kp = random.uniform(0.4, 0.72) / (gain * (delay + sum(lags) + SAMPLE / 2))
    step = random.uniform(0.5, 1.5) * random.choice([-1.0, 1.0])
    return Vehicle(delay, gain, tuple(one for one in lags if one), Kp, step)


def first_order_noise(
    keep: float, deviation: float, size: int, random: np.random.Generator
) -> Array:
    """Stationary noise x[k+1] = keep x[k] + white."""
    shocks = deviation * random.standard_normal(size)
    shocks[1:] *= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], shocks))


def air_response(
    condition: Condition, lag: float, times: Array, random: np.random.Generator
) -> Array:
    """Output that the air and the trim add, zero at time zero.

    A random walk begins at zero velocity; gusts, and what the lag makes of them, are stationary.
    """
    step = SAMPLE / POINTS
    size = int(np.ceil(times[-1] / step)) + 1
    start = 0.0
    if condition.gust is not None:
        deviation, correlation_time = condition.gust
        air = first_order_noise(np.exp(-step / correlation_time), deviation, size, random)
        share = correlation_time / (correlation_time + lag)
        start = share * air[0] + deviation * np.sqrt(share - share**2) * random.standard_normal()
    else:
        shocks = condition.air * np.sqrt(step) * random.standard_normal(size)
        air = np.cumsum(shocks) - shocks[0]
    mean = (air[1:] + air[:-1]) / 2.0
    moved = step * mean
    if lag:
        keep = np.exp(-step / lag)
        velocity, _ = lfilter([1.0 - keep], [1.0, -keep], mean, zi=[keep * start])
        moved += lag * (1.0 - keep) * (np.concatenate([[start], velocity[:-1]]) - mean)
    output = np.concatenate([[0.0], np.cumsum(moved)])
    return np.interp(times, step * np.arange(size), output) + condition.trim * times


def drawn_delays(
    condition: Condition, delay: float, times: Array, random: np.random.Generator
) -> Array:
    """The delay of each command."""
    wander = first_order_noise(np.exp(-SAMPLE), condition.delay_wander, times.size, random)
    drift = condition.delay_ramp * (times / times[-1] - 0.5)
    return np.maximum(delay + wander + drift, 0.0)


def drawn_log(
    condition: Condition, times: Array, step_time: float, random: np.random.Generator
) -> tuple[Array, Mask]:
    """Stamps of the rows, and which rows are logged."""
    stamps = SAMPLE * np.arange(times.size) if condition.nominal_stamps else times
    jitter = random.uniform(-1.0, 1.0, times.size) * condition.stamp_jitter
    logged = random.random(times.size) >= condition.rows_lost
    logged &= np.arange(times.size) % condition.every == 0
    hole = step_time + random.uniform(0.1, 0.6)
    logged &= (times < hole) | (times >= hole + condition.hole)
    return condition.clock * stamps + jitter, logged


def record(condition: Condition, number: int) -> Run:
    """Run `number` of the condition; it depends on the condition's name and on nothing else."""
    random = np.random.default_rng([zlib.crc32(condition.name.encode()), number])
    vehicle = drawn_vehicle(condition, random)
    rows = np.arange(condition.rows)
    times = SAMPLE * rows + condition.sampling_jitter * random.uniform(-1.0, 1.0, rows.size)
    times -= times[0]
    first = random.integers(condition.rest[0], condition.rest[1], endpoint=True)
    reference = np.where(rows >= first, vehicle.step, 0.0)
    delays = drawn_delays(condition, vehicle.delay, times, random)
    arrivals = np.maximum.accumulate(times + delays)
    arrived = random.random(rows.size) >= condition.commands_lost
    noise = condition.white * random.standard_normal(rows.size)
    noise += (condition.correlation > 0.0) * first_order_noise(
        condition.correlation, CORRELATED, rows.size, random
    )
    outlying = random.random(rows.size) < condition.outliers
    size = random.uniform(0.05, 0.3, rows.size) * random.choice([-1.0, 1.0], rows.size)
    noise += np.where(outlying, size, 0.0)
    path = air_response(condition, sum(vehicle.lags), times, random)
    path += condition.quantum * random.uniform(-0.5, 0.5)  # where the sensor's steps lie
    stamps, logged = drawn_log(condition, times, times[first], random)

    measured, command, jumps = np.zeros((3, rows.size))
    held = 0.0
    for k in rows:
        path[k] += vehicle.gain * (jumps[:k] @ ramp(times[k] - arrivals[:k], vehicle.lags))
        measured[k] = path[k] + noise[k]
        if condition.quantum:
            measured[k] = condition.quantum * np.round(measured[k] / condition.quantum)
        command[k] = np.clip(vehicle.Kp * (reference[k] - measured[k]), -LIMIT, LIMIT)
        if arrived[k]:
            jumps[k], held = command[k] - held, command[k]
    if condition.delay_wander or condition.delay_ramp:
        vehicle = replace(vehicle, delay=deciding_delay(times, arrivals, jumps, delays))
    return Run(
        vehicle, times, arrivals, stamps, reference, path, measured, command, logged, outlying
    )


def deciding_delay(times: Array, arrivals: Array, jumps: Array, delays: Array) -> float:
    """The constant delay that is nearest to the delays of the commands.

    A command that jumps by J and arrives d late moves the output of an integrator by -J d from then
    on. This is the d of all commands, beside gain and level, that least squares finds in it,
    without noise, for a plant of unit gain without lag.
    """
    age = times[:, None] - arrivals
    arrived = age > 0.0
    columns = [-(arrived @ jumps), ramp(age, ()) @ jumps, np.ones(times.size)]
    found, *_ = np.linalg.lstsq(
        np.stack(columns, axis=1), -(arrived @ (jumps * delays)), rcond=None
    )
    return float(found[0])
