"""The command of a log between its rows.

Rows that are rarer than the changes of a command leave open what it was between them. A command
that is smooth over a few rows is the cubic through them: each row is predicted from the second
and the fourth of its neighbours to either side, by a straight line and by a cubic; the better one
is taken. Of one that jumps a straight line is the mean of what it may have been.

The mean of many rows of the output over a time w is the response to the mean of the command over w,
for filters commute. That of a command that holds is straight between corners.
"""

from __future__ import annotations

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs.latencies._commands import Between

#: Points for each row of a cubic, straight between them, of few rows and of more than so many: the
#: error falls with the number squared.
FINER, LESS, MANY = 4, 2, 2000

#: Rows of which at least some tell whether a command is smooth.
FEWEST = 12

#: Points for each width of a mean: more are nearer to its corners and take longer.
POINTS = 2


def is_smooth(values: Array) -> bool:
    """Whether a cubic predicts rows better than a straight line does, from those around them."""
    if values.size < FEWEST:
        return False
    near, middle = values[2:-4] + values[4:-2], values[3:-3]
    far = values[:-6] + values[6:]
    line = middle - 0.5 * near
    cubic = middle - (9.0 * near - far) / 16.0
    return bool(np.sum(cubic**2) < np.sum(line**2))


def refined(time: Array, values: Array) -> tuple[Array, Array]:
    """Times and values of a straight command, with points on the cubic where it is smooth."""
    from scipy.interpolate import CubicSpline

    if not is_smooth(values):
        return time, values
    finer = FINER if time.size <= MANY else LESS
    rows = np.arange(finer * (time.size - 1) + 1) / finer
    fine = np.interp(rows, np.arange(time.size), time)
    return fine, np.asarray(CubicSpline(time, values)(fine))


def moving_mean(time: Array, values: Array, between: Between, width: float) -> tuple[Array, Array]:
    """The mean of a command over a width, s, around new times, straight between them."""
    steps = np.diff(time)
    slopes = np.zeros(time.size)
    if between == "straight":
        slopes[:-1] = np.diff(values) / steps
    areas = np.append(0.0, np.cumsum((values[:-1] + 0.5 * slopes[:-1] * steps) * steps))

    def area(at: Array) -> Array:
        row = np.maximum(np.searchsorted(time, at, side="right") - 1, 0)
        since = at - time[row]
        # Before its first row the command is that of it.
        return np.asarray(areas[row] + (values[row] + 0.5 * slopes[row] * since.clip(0.0)) * since)

    count = max(2, int(POINTS * (time[-1] - time[0]) / width) + 1)
    at = np.linspace(time[0], time[-1], count)
    return at, (area(at + 0.5 * width) - area(at - 0.5 * width)) / width
