"""Rows with the time stamp of the row before them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import RecordingError

#: Largest share of rows that may have the time of the row before. More: clocks that print too few
#: digits are taken as they are; less: a table with one row logged twice is refused.
MOST_REPEATED = 0.01


def spread(time: NDArray[np.float64], where: str, first: float) -> NDArray[np.float64]:
    """The times with rows of one time placed evenly after the row before.

    The last row of each time keeps it: what it holds was true then. The first rows of a table are
    placed a median interval before each other. Refused, with the place of the
    first, where there are too many.
    """
    last = np.append(np.diff(time) > 0.0, True)
    if np.mean(~last) > MOST_REPEATED:
        raise time_error(where, first, first)
    rows = np.arange(time.size, dtype=float)
    kept, stamps = rows[last], time[last]
    interval = float(np.median(np.diff(stamps)))
    if not last[0]:  # the rows before the first kept one are even
        begin = stamps[0] - kept[0] * interval
        kept, stamps = np.append(0.0, kept), np.append(begin, stamps)
    placed: NDArray[np.float64] = np.interp(rows, kept, stamps)
    return placed


def time_error(where: str, before: float, now: float) -> RecordingError:
    """What is wrong with a time that does not increase."""
    what = "repeats" if now == before else "goes back"
    return RecordingError(
        f"{where}: the time {what} ({before!r} is followed by {now!r}). Sort the rows, and keep "
        "one row of each time stamp"
    )
