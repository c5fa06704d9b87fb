"""Windows of time: where a state holds, and what two of them share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array, Mask
from deadtime.logs._names import Windows


def windows_of(time: Array, holds: Mask) -> Windows:
    """Where a logged state holds: from its row until the next row that denies it.

    The last state holds to infinity. Before the first row the state of that row is assumed.
    """
    if time.size == 0:
        return []
    changes = np.flatnonzero(np.diff(holds.astype(np.int8))) + 1
    starts = [-np.inf, *time[changes].tolist()]
    stops = [*starts[1:], np.inf]
    kept = holds[np.concatenate(([0], changes))]
    return [
        (start, stop)
        for start, stop, keep in zip(starts, stops, kept, strict=True)
        if keep and start < stop
    ]


def changes_of(time: Array, numbers: NDArray[np.int64]) -> list[tuple[float, int]]:
    """Each number with the time of the first row from which it stays."""
    rows = np.concatenate(([0], np.flatnonzero(np.diff(numbers)) + 1))
    return [(float(time[k]), int(numbers[k])) for k in rows]


def runs(holds: Mask) -> list[tuple[int, int]]:
    """First row, and the row after the last one, of each run in which a state holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], holds.astype(np.int8), [0]))))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def held_rows(time: Array, holds: Mask) -> Windows:
    """First and last time of each run of rows in which a state holds."""
    return [(float(time[a]), float(time[b - 1])) for a, b in runs(holds)]


def shared(some: Windows, others: Windows) -> Windows:
    """What two sorted lists of windows share."""
    found, i, j = [], 0, 0
    while i < len(some) and j < len(others):
        start, stop = max(some[i][0], others[j][0]), min(some[i][1], others[j][1])
        if start < stop:
            found.append((start, stop))
        if some[i][1] < others[j][1]:
            i += 1
        else:
            j += 1
    return found


def outside(windows: Windows) -> Windows:
    """The time that is in none of the sorted windows."""
    found, last = [], -np.inf
    for start, stop in windows:
        if last < start:
            found.append((last, start))
        last = max(last, stop)
    if last < np.inf:
        found.append((last, np.inf))
    return found


def length(windows: Windows) -> float:
    """Sum of the lengths, s."""
    return float(sum(stop - start for start, stop in windows))
