"""Recordings of vehicles with lags and a zero, by partial fractions: independent of the package."""

import math

import numpy as np
from deadtime import Recording


def step_answer(age, lags, zero, integrator):
    """Response of (zero s + 1)/((lag s + 1) …), with 1/s for an integrator, `age` after a step.

    The lags must differ from each other.
    """
    age = np.maximum(age, 0.0)
    found = age + zero - sum(lags) if integrator else np.ones_like(age)
    for i, lag in enumerate(lags):
        share = math.prod(lag / (lag - other) for j, other in enumerate(lags) if j != i)
        weight = (lag - zero) * share if integrator else (zero / lag - 1.0) * share
        found = found + weight * np.exp(-age / lag)
    return np.where(age > 0.0, found, 0.0)


def answer(times, command_time, command, *, delay, lags, zero=0.0, gain=1.0, integrator=False):
    """Output at `times` under commands that hold from their times on."""
    jumps = np.diff(command, prepend=0.0)
    ages = times[:, None] - command_time - delay
    return gain * (step_answer(ages, lags, zero, integrator) @ jumps)


def record_attitude(seed, *, noise=0.003, rows=250, sample=0.02, **vehicle):
    """A square wave of 0.2 rad told to a vehicle, and the attitude it logs."""
    random = np.random.default_rng(seed)
    time = sample * np.arange(rows)
    told = np.where(time > 0.3, 0.2 * np.sign(np.sin(3.7 * (time - 0.3))), 0.0)
    output = answer(time, time, told, **vehicle) + noise * random.standard_normal(rows)
    return Recording(time, told, output, command=told)
