"""Rows of a recording for the likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime.estimation._native import SEARCHED_ROWS, excited_part as native_part

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


def is_long(runs: Sequence[FlightRows]) -> bool:
    """Whether a search on all rows would take too long."""
    return any(rows.time.size > SEARCHED_ROWS for rows in runs)


def excited_part(rows: FlightRows) -> FlightRows:
    """The rows of a search: all, or those of a long recording in which the command changes most.

    They keep the commands of as long a time before them. What those before have left is a part of
    the offset.
    """
    part = native_part(rows.time, rows.command_time, rows.command)
    if part is None:
        return rows
    kept, sent = slice(*part[:2]), slice(*part[2:])
    start, stop = rows.time[kept.start], rows.time[kept.stop - 1]
    return rows._replace(
        time=rows.time[kept],
        row_time=float(np.median(np.diff(rows.time[kept]))),
        output=rows.output[kept],
        used=rows.used[kept],
        speed=rows.speed[kept],
        command_time=rows.command_time[sent],
        command=rows.command[sent],
        unknown=tuple(one for one in rows.unknown if start < one[1] and one[0] < stop),
        uncertain=tuple(one for one in rows.uncertain if start < one[1] and one[0] < stop),
        offset=rows.offset or kept.start > 0,
    )


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
