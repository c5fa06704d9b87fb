"""Two methods that measure a loop's latency from setpoint and response, and what they measure.

Viewers of flight logs deconvolve the response by the setpoint in Hann windows, average the step
responses and show where they cross one half. Driver assistance takes the lag at which the masked,
normalised cross-correlation of setpoint and response is largest. Both are of the closed loop: they
depend on the controller as well as on delay and lag. The true values are those of the loop without
noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import t as student

from rate_loops.generator import BEFORE, SAMPLE, Array, Vehicle, fly

#: Windows of the deconvolution: their rows, the rows from one to the next, and how much of the
#: response is computed. Windows whose setpoint stays below the least are left out.
WINDOW, HOP, RESPONSE, LEAST = 1000, 125, 300, 0.5

#: Power that is added to that of the setpoint, as a share of its largest. This and the windows have
#: the least error on these logs: shorter windows make the crossing early, more power makes it late.
WIENER = 1e-2

#: Largest lag of the correlation, rows; setpoint below which a row is masked, rad/s; blocks of rows
#: whose lags scatter.
LONGEST, QUIET, BLOCKS = 200, 0.1, 4


class Measured(NamedTuple):
    """A time and half the width of its 95 % interval, s; NaN where there is none."""

    value: float
    half: float


def half_width(parts: Array, independent: float) -> float:
    """Half a 95 % interval of a mean from the scatter of its parts, by Student's distribution."""
    if independent <= 1.0:
        return math.nan
    quantile = float(student.ppf(0.975, independent - 1.0))
    return quantile * float(np.std(parts, ddof=1)) / math.sqrt(independent)


def crossing(step: Array) -> float:
    """First time at which a step response crosses one half, s."""
    above = np.flatnonzero(step >= 0.5)
    if not above.size or above[0] == 0:
        return math.nan
    k = int(above[0])
    return SAMPLE * (k - 1 + (0.5 - step[k - 1]) / (step[k] - step[k - 1]))


def true_crossing(vehicle: Vehicle) -> float:
    """The same of the closed loop without noise."""
    return crossing(fly(vehicle, np.ones(RESPONSE), None)[0])


def step_crossing(setpoint: Array, response: Array) -> Measured:
    """Crossing of one half of the deconvolved step response; the interval from the windows."""
    hann = np.hanning(WINDOW)
    steps = []
    for begin in range(0, setpoint.size - WINDOW + 1, HOP):
        rows = slice(begin, begin + WINDOW)
        if np.max(np.abs(setpoint[rows])) < LEAST:
            continue
        X, Y = (np.fft.rfft(hann * one[rows], 2 * WINDOW) for one in (setpoint, response))
        power = np.abs(X) ** 2
        impulse = np.fft.irfft(np.conj(X) * Y / (power + WIENER * np.max(power)))
        steps.append(np.cumsum(impulse[:RESPONSE]))
    if not steps:
        return Measured(math.nan, math.nan)
    times = np.array([crossing(step) for step in steps])
    times = times[np.isfinite(times)]
    half = half_width(times, times.size * HOP / WINDOW)
    return Measured(crossing(np.mean(steps, axis=0)), half)


def correlation(setpoint: Array, response: Array, mask: Array) -> Array:
    """Normalised cross-correlation over lags of 0 to `LONGEST` rows, masked (Padfield 2012)."""
    found = np.zeros(LONGEST + 1)
    for lag in range(LONGEST + 1):
        both = mask[: mask.size - lag] & mask[lag:]
        x, y = setpoint[: mask.size - lag][both], response[lag:][both]
        if x.size > LONGEST:
            x, y = x - x.mean(), y - y.mean()
            scale = math.sqrt((x @ x) * (y @ y))
            found[lag] = x @ y / scale if scale else 0.0
    return found


def parabolic_peak(values: Array) -> float:
    """Time of the largest value, between rows by a parabola, s; NaN at an end."""
    k = int(np.argmax(values))
    if not 0 < k < values.size - 1:
        return math.nan
    low, middle, high = values[k - 1 : k + 2]
    return SAMPLE * (k + 0.5 * (low - high) / (low - 2.0 * middle + high))


def correlation_lag(setpoint: Array, response: Array) -> Measured:
    """Lag of the largest correlation; the interval from blocks of the log."""
    mask = np.abs(setpoint) >= QUIET
    parts = np.array_split(np.arange(mask.size), BLOCKS)
    lags = np.array([parabolic_peak(correlation(setpoint[p], response[p], mask[p])) for p in parts])
    lags = lags[np.isfinite(lags)]
    value = parabolic_peak(correlation(setpoint, response, mask))
    return Measured(value, half_width(lags, lags.size))


def true_lag(vehicle: Vehicle, setpoint: Array) -> float:
    """The same of this setpoint and the response of the closed loop without noise."""
    flown = np.concatenate([np.zeros(BEFORE), setpoint])
    response = fly(vehicle, flown, None)[0][BEFORE:]
    values = correlation(setpoint, response, np.abs(setpoint) >= QUIET)
    k = int(np.argmax(values))
    rows = np.arange(max(k - 5, 0), min(k + 6, values.size))
    peaks = CubicSpline(SAMPLE * rows, values[rows]).derivative().roots(extrapolate=False)
    return float(peaks[np.argmin(np.abs(peaks - SAMPLE * k))]) if peaks.size else math.nan
