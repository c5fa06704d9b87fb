"""The drone's clock: whole microseconds since it was switched on, as its navdata have it.

Every event of the emulator lies on it, so that times compare exactly and a run does not depend on
how often, or how late, it is asked to go on.
"""

from __future__ import annotations

from typing import TypeAlias

__all__ = ["SECOND", "Micros", "micros", "seconds"]

#: A time or a duration in microseconds.
Micros: TypeAlias = int

SECOND: Micros = 1_000_000


def micros(time: float) -> Micros:
    """Seconds in whole microseconds."""
    return round(time * SECOND)


def seconds(time: Micros) -> float:
    """Microseconds in seconds."""
    return time / SECOND
