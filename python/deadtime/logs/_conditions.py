"""Conditions of loops from logged states and from flight modes."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime.logs._contents import LogContents
from deadtime.logs._names import Condition, FindWindows, Windows
from deadtime.logs._series import increasing
from deadtime.logs._windows import outside, windows_of

#: Longest time from touch-down until the autopilot notices it, s: 2.1 in a landing of a simulated
#: PX4. Meanwhile the vehicle follows no setpoint.
NOTICED = 2.5


def state(topic: str, column: str, holds: Callable[[Array], Mask]) -> FindWindows:
    """Where a logged column passes a test; None if it is not in the log."""

    def windows(contents: LogContents) -> Windows | None:
        found = contents.topics.get(topic)
        if found is None or column not in found.columns:
            return None
        rows = increasing(found.time, last=True)
        if not rows.any():
            return None
        return windows_of(found.time[rows], holds(np.asarray(found.columns[column])[rows]))

    return windows


def in_the_air(topic: str, column: str, holds: Callable[[Array], Mask]) -> FindWindows:
    """Where a vehicle says that it flies, without the time in which its landing goes unnoticed."""
    flights = state(topic, column, holds)

    def windows(contents: LogContents) -> Windows | None:
        found = flights(contents)
        if found is None:
            return None
        return [(start, stop - NOTICED) for start, stop in found if stop - NOTICED > start]

    return windows


def first_logged(*ways: FindWindows) -> FindWindows:
    """The answer of the first of these that the log tells about."""

    def windows(contents: LogContents) -> Windows | None:
        for way in ways:
            found = way(contents)
            if found is not None:
                return found
        return None

    return windows


def in_modes(modes: Collection[str]) -> FindWindows:
    """Where one of these flight modes is active; None if the log tells no mode."""

    def windows(contents: LogContents) -> Windows | None:
        if not contents.modes:
            return None
        time = np.array([at for at, _ in contents.modes])
        active = np.array([name in modes for _, name in contents.modes])
        kept = increasing(time, last=True)
        return windows_of(time[kept], active[kept])

    return windows


def not_in_modes(modes: Collection[str]) -> FindWindows:
    """Where none of these flight modes is active; None if the log tells no mode."""
    inside = in_modes(modes)

    def windows(contents: LogContents) -> Windows | None:
        found = inside(contents)
        return None if found is None else outside(found)

    return windows


def closed_where(windows: FindWindows) -> Condition:
    """The condition that the flight mode closes a loop."""
    return Condition(windows, "in this flight mode the loop is open")
