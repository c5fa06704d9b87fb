"""Rows of a recording for the likelihood, and which of them are outliers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array, Mask

#: Spikes of the residuals beyond so many robust deviations are outliers, at most this share of the
#: rows. Half a window of the median that spikes are measured from, in rows.
SPIKE, MOST_SPIKES, HALF_WINDOW = 6.0, 0.15, 2

#: Median absolute deviation of a Gaussian, and the least robust deviation as a share of the plain.
MAD, LEAST_ROBUST = 0.6745, 0.1


#: Steps of a rounded output are multiples of the least, within this share of it, and at least this
#: share of the rows is equal to the row before.
ROUNDING, ROUNDED = 1e-6, 0.2

#: Share of the rows at which a rounded output turns back from which its noise is about half a step.
#: Rounding errors are then as good as white, and every row tells (Widrow 1961).
DITHERED = 0.18

#: Rows whose times do not scatter.
NO_SPEED = np.empty(0)


class FlightRows(NamedTuple):
    """What the kernel is given of one recording; `row_time` is the median time between rows, s."""

    time: Array
    row_time: float
    output: Array
    used: Mask
    command_time: Array
    command: Array
    unknown: tuple[tuple[float, float], ...]
    offset: bool
    uncertain: tuple[tuple[float, float, float], ...] = ()
    trim: bool = False
    speed: Array = NO_SPEED
    rounding: float = 0.0


def spikes(residuals: Array, rounding: float) -> Mask:
    """Rows of these residuals that are outliers: far from the median of their neighbours.

    Rows within a step of the rounding are none.
    """
    away, robust = _from_neighbours(residuals)
    found = np.abs(away) > max(SPIKE * robust, rounding)
    if robust == 0.0:
        found[:] = False
    if np.sum(found) > MOST_SPIKES * away.size:
        return np.zeros(away.size, dtype=bool)
    return found


def _from_neighbours(residuals: Array) -> tuple[Array, float]:
    """Difference from the median of the rows around, and its robust deviation.

    At the ends the window is as wide and on one side, because two of its rows may be outliers. A
    slope of the residuals shows there, so that the deviation is that of the other rows.
    """
    wide = min(2 * HALF_WINDOW + 1, residuals.size)
    windows = np.sort(np.lib.stride_tricks.sliding_window_view(residuals, wide), axis=1)
    medians = 0.5 * (windows[:, (wide - 1) // 2] + windows[:, wide // 2])
    places = np.arange(residuals.size) - HALF_WINDOW
    away = residuals - medians[np.clip(places, 0, medians.size - 1)]
    inner = away[(places >= 0) & (places < medians.size)]
    robust = float(np.median(np.abs(inner[inner != 0.0]))) / MAD if np.any(inner) else 0.0
    return away, max(robust, LEAST_ROBUST * float(np.std(inner)))


def is_outlier(whitened: Array, residuals: Array, rows: FlightRows) -> Mask:
    """Rows whose whitened residual, in robust deviations, is beyond `SPIKE`.

    Rows within a step of the rounding are none.
    """
    used = rows.used
    sizes = np.abs(whitened[used])
    robust = max(float(np.median(sizes)) / MAD, LEAST_ROBUST)
    found = used & (np.abs(whitened) > SPIKE * robust) & (np.abs(residuals) > rows.rounding)
    if np.sum(~used) + np.sum(found) > MOST_SPIKES * used.size:
        return np.zeros(used.size, dtype=bool)
    # The rows after an outlier are predicted from it: only the first of a run is one.
    return np.asarray(found & ~np.r_[False, found[:-1]])


def rounding_of(output: Array) -> float:
    """The step to which an output was rounded, if its rows often stay on one step; else zero.

    None counts where noise moves the output to and fro over its steps.
    """
    changes = np.diff(output)
    changes = changes[changes != 0.0]
    if np.count_nonzero(changes[1:] * changes[:-1] < 0.0) > DITHERED * output.size:
        return 0.0
    steps = np.diff(np.unique(output))
    step = float(np.min(steps, initial=np.inf))
    is_rounded = np.all(np.abs(steps - step * np.rint(steps / step)) < ROUNDING * step)
    return step if steps.size and is_rounded and np.mean(np.diff(output) == 0.0) >= ROUNDED else 0.0


def on_same_step(output: Array) -> Mask:
    """Rows of a rounded output that tell nothing besides another row on the same step.

    Neighbours on one step of the sensor have the same rounding error. Of those the middle row
    stays, where that error is least; of two in the middle the earlier and the later one in turn, so
    that none makes the output early.
    """
    first = np.flatnonzero(np.r_[True, np.diff(output) != 0.0])
    ends = np.r_[first[1:], output.size]
    found = np.ones(output.size, dtype=bool)
    found[(first + ends - 1 + np.arange(first.size) % 2) // 2] = False
    return found
