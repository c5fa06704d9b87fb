"""Logs of a multirotor's roll-rate loop at 1 kHz, made without `deadtime`.

A discrete PI controller reads the filtered gyro and sends a torque. It arrives after the transport
delay, is held until the next arrives, and passes the motors (one lag). Gusts and trim are torques
that are added to that of the motors before the airframe integrates it. The gyro is read once a row,
with white noise, and passes a digital low-pass as flight controllers have it. Torques and rate are
one linear stochastic differential equation, which is stepped exactly from row to row.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import butter, lfilter, sosfilt

Array = NDArray[np.float64]

#: Sample time of controller and log, s; rows of a log, and rows that are flown before it.
SAMPLE, ROWS, BEFORE = 1e-3, 4000, 1000

#: Corner of the gyro's low-pass, Hz.
CORNER = 100.0

#: Rows after which nothing is left of an impulse into it.
FADED = 200

#: Deviation of the torque of gusts, rad/s², and its correlation time, s.
GUST, GUST_TIME = 4.0, 0.3

#: Deviation of the constant torque, rad/s².
TRIM = 3.0

#: Deviation of the gyro's noise behind the filter, rad/s, and of that of the log's digits.
GYRO, DIGITS = 0.03, 0.003

#: Places in the state: those of the vehicle, and the output of the low-pass before its memory.
GUSTS, MOTORS, RATE, FILTERED = range(4)


def low_pass(order: int) -> tuple[Array, Array]:
    """Coefficients b and a of a first-order lag, or of a Butterworth filter of second order."""
    if order == 1:
        part = 2.0 * math.pi * CORNER * SAMPLE
        k = part / (part + 1.0)
        return np.array([k]), np.array([1.0, k - 1.0])
    b, a = butter(order, CORNER, fs=1.0 / SAMPLE)
    return b, a


@dataclass(frozen=True)
class Vehicle:
    """The truth of one run: SI units; `order` is that of the gyro's low-pass."""

    delay: float
    lag: float
    gain: float
    order: int
    Kp: float
    Ki: float
    trim: float

    @property
    def filter_lag(self) -> float:
        """Delay of the gyro's low-pass at low frequencies, s."""
        b, a = low_pass(self.order)
        late = [np.average(np.arange(part.size), weights=part) for part in (b, a)]
        return SAMPLE * float(late[0] - late[1])


@dataclass(frozen=True)
class Log:
    """One run as it was logged; arrays have a value for each row."""

    vehicle: Vehicle
    time: Array
    setpoint: Array
    response: Array
    actuator: Array


def drift(vehicle: Vehicle) -> Array:
    """F of dx = F x dt + torque: gust, motors, rate."""
    F = np.zeros((FILTERED, FILTERED))
    F[GUSTS, GUSTS] = -1.0 / GUST_TIME
    F[MOTORS, MOTORS] = -1.0 / vehicle.lag
    F[RATE, [GUSTS, MOTORS]] = 1.0
    return F


def memory(order: int) -> tuple[Array, Array]:
    """A and b of the low-pass, w = A w + b x for each reading x; its output is the first of w.

    The rest of w is what it keeps for the next readings (direct form II, transposed).
    """
    b, a = low_pass(order)
    size = a.size
    b = np.pad(b, (0, size - b.size))
    A = np.eye(size, k=1)
    A[1:, 1] -= a[1:]
    return A, b - b[0] * np.concatenate([[0.0], a[1:]])


def read(vehicle: Vehicle, change: Array) -> Array:
    """What a change of gust, motors and rate in a sample is worth in the whole state after it."""
    return np.concatenate([change, memory(vehicle.order)[1] * change[RATE]])


def reading_noise(order: int) -> float:
    """Deviation of the gyro's noise before the low-pass, which leaves `GYRO` of it."""
    impulse = lfilter(*low_pass(order), np.eye(1, FADED)[0])
    return GYRO / math.sqrt(impulse @ impulse)


def stepped(vehicle: Vehicle) -> tuple[Array, Array]:
    """Transition over a sample and covariance of what is added in it (Van Loan 1978)."""
    F = drift(vehicle)
    intensity = np.zeros((FILTERED, FILTERED))
    intensity[GUSTS, GUSTS] = 2.0 * GUST**2 / GUST_TIME
    whole = expm(np.block([[-F, intensity], [np.zeros_like(F), F.T]]) * SAMPLE)
    flown = whole[FILTERED:, FILTERED:].T
    added = flown @ whole[:FILTERED, FILTERED:]
    kept, b = memory(vehicle.order)
    size = FILTERED + b.size
    A = np.zeros((size, size))
    A[:FILTERED, :FILTERED] = flown
    A[FILTERED:, :FILTERED] = np.outer(b, flown[RATE])
    A[FILTERED:, FILTERED:] = kept
    into = np.vstack([np.eye(FILTERED), np.outer(b, np.eye(FILTERED)[RATE])])
    Q = into @ added @ into.T
    Q[FILTERED:, FILTERED:] += reading_noise(vehicle.order) ** 2 * np.outer(b, b)
    return A, Q


def held(vehicle: Vehicle, column: int, duration: float = SAMPLE) -> Array:
    """Gust, motors and rate after an input of one into `column` over this time."""
    block = np.zeros((FILTERED + 1, FILTERED + 1))
    block[:FILTERED, :FILTERED], block[column, FILTERED] = drift(vehicle), 1.0
    return np.asarray(expm(block * duration)[:FILTERED, FILTERED])


def arrivals(vehicle: Vehicle) -> tuple[int, Array, Array]:
    """Whole samples of delay, and effects in a sample of the command before and after the change.

    A torque of u into the motors is `gain` u / lag of the slope of their state.
    """
    whole, part = divmod(vehicle.delay, SAMPLE)
    scale = vehicle.gain / vehicle.lag
    after = scale * held(vehicle, MOTORS, SAMPLE - part)
    before = scale * held(vehicle, MOTORS) - after
    return int(whole), read(vehicle, before), read(vehicle, after)


def fly(vehicle: Vehicle, setpoint: Array, random: np.random.Generator | None) -> tuple[Array, ...]:
    """Measured rate and command of the closed loop, from rest; without `random` without noise.

    The noise begins stationary. Without it there is no trim either.
    """
    A, Q = stepped(vehicle)
    size = len(A)
    whole, before, after = arrivals(vehicle)
    rows = setpoint.size
    added, digits, state = np.zeros((rows, size)), np.zeros(rows), np.zeros(size)
    if random is not None:
        values, vectors = np.linalg.eigh(Q)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        added = random.standard_normal((rows, size)) @ root.T
        added += vehicle.trim * read(vehicle, held(vehicle, RATE))
        digits = DIGITS * random.standard_normal(rows)
        state[GUSTS] = GUST * random.standard_normal()
    measured, command = np.zeros((2, rows))
    sent = np.zeros(rows + whole + 1)
    integral = 0.0
    for k in range(rows):
        measured[k] = state[FILTERED] + digits[k]
        error = setpoint[k] - measured[k]
        integral += vehicle.Ki * SAMPLE * error
        command[k] = vehicle.Kp * error + integral
        sent[k + whole + 1] = command[k]
        # sent[k + 1] is the command that changes in this sample, sent[k] that before it.
        state = A @ state + before * sent[k] + after * sent[k + 1] + added[k]
    return measured, command


def drawn_vehicle(order: int, random: np.random.Generator) -> Vehicle:
    """A vehicle, and a PI controller with which its loop is well damped."""
    delay = random.uniform(0.002, 0.008)
    lag, gain = 0.03 * random.uniform(0.8, 1.2), random.uniform(60.0, 150.0)
    vehicle = Vehicle(delay, lag, gain, order, 0.0, 0.0, TRIM * random.standard_normal())
    crossing = random.uniform(0.5, 0.7) / (delay + lag + vehicle.filter_lag)
    return replace(vehicle, Kp=crossing / gain, Ki=0.1 * crossing**2 / gain)


def drawn_setpoint(random: np.random.Generator) -> Array:
    """Sticks of a pilot, with two doublets; at rest before the log and in its first 0.2 s."""
    time = SAMPLE * np.arange(ROWS)
    filters = butter(2, 2.0, fs=1.0 / SAMPLE, output="sos")
    sticks = sosfilt(filters, random.standard_normal(2 * ROWS))[-ROWS:]
    sticks *= np.clip((time - 0.2) / 0.2, 0.0, 1.0) / np.std(sticks)
    for begin in (random.uniform(0.4, 1.2), random.uniform(2.0, 2.8)):
        width = random.uniform(0.1, 0.3)
        size = random.uniform(1.5, 3.0) * random.choice([-1.0, 1.0])
        sticks += size * ((time >= begin) & (time < begin + width))
        sticks -= size * ((time >= begin + width) & (time < begin + 2.0 * width))
    return np.concatenate([np.zeros(BEFORE), sticks])


def record(order: int, number: int) -> Log:
    """Run `number` with a low-pass of this order; it depends on nothing else."""
    random = np.random.default_rng([zlib.crc32(b"rate loop"), order, number])
    vehicle, setpoint = drawn_vehicle(order, random), drawn_setpoint(random)
    measured, command = fly(vehicle, setpoint, random)
    time = SAMPLE * np.arange(ROWS)
    return Log(vehicle, time, setpoint[BEFORE:], measured[BEFORE:], command[BEFORE:])
