"""Rows of a recording for the likelihood, and which of them are outliers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Spikes of the residuals beyond so many robust deviations are outliers, at most this share of the
#: rows. Half a window of the median that spikes are measured from, in rows.
SPIKE, MOST_SPIKES, HALF_WINDOW = 6.0, 0.15, 2

#: Median absolute deviation of a Gaussian, and the least robust deviation as a share of the plain.
MAD, LEAST_ROBUST = 0.6745, 0.1


class FlightRows(NamedTuple):
    """What the kernel is given of one recording."""

    time: Array
    output: Array
    used: NDArray[np.bool_]
    command_time: Array
    command: Array
    unknown: tuple[tuple[float, float], ...]
    offset: bool
    uncertain: tuple[tuple[float, float, float], ...] = ()
    trim: bool = False


def spikes(residuals: Array) -> NDArray[np.bool_]:
    """Rows of these residuals that are outliers: far from the median of their neighbours."""
    away, robust = _from_neighbours(residuals)
    found = np.abs(away) > SPIKE * robust if robust > 0.0 else np.zeros(away.size, dtype=bool)
    if np.sum(found) > MOST_SPIKES * away.size:
        return np.zeros(away.size, dtype=bool)
    return found


def _from_neighbours(residuals: Array) -> tuple[Array, float]:
    """Difference from the median of the rows around, and its robust deviation."""
    padded = np.pad(residuals, HALF_WINDOW, mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * HALF_WINDOW + 1)
    away = np.asarray(residuals - np.median(around, axis=1))
    robust = float(np.median(np.abs(away[away != 0.0]))) / MAD if np.any(away) else 0.0
    return away, max(robust, LEAST_ROBUST * float(np.std(away)))


def is_outlier(whitened: Array, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows whose whitened residual, in robust deviations, is beyond `SPIKE`."""
    sizes = np.abs(whitened[used])
    robust = max(float(np.median(sizes)) / MAD, LEAST_ROBUST)
    found = used & (np.abs(whitened) > SPIKE * robust)
    if np.sum(~used) + np.sum(found) > MOST_SPIKES * used.size:
        return np.zeros(used.size, dtype=bool)
    # The rows after an outlier are predicted from it: only the first of a run is one.
    return np.asarray(found & ~np.r_[False, found[:-1]])
