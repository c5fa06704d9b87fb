"""The clock of the drone: whole microseconds since it was switched on, as in its navdata.

All events of the emulator have times of this clock, so that times compare exactly and a run does
not depend on when it is advanced.
"""

from __future__ import annotations

from typing import TypeAlias

#: A time or a duration in microseconds.
Micros: TypeAlias = int

SECOND: Micros = 1_000_000


def micros(time: float) -> Micros:
    """Seconds in whole microseconds."""
    return round(time * SECOND)


def seconds(time: Micros) -> float:
    """Microseconds in seconds."""
    return time / SECOND
