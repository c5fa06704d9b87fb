"""Intervals of gains and delays as arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import SupportsFloat, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._base.validation import Range, interval
from deadtime.roots._family import HasFamily

__all__ = [
    "MOST_MOVING",
    "Floats",
    "Given",
    "Range",
    "System",
    "Values",
    "ranges_of",
    "side",
]

Floats: TypeAlias = NDArray[np.float64]
System: TypeAlias = HasFamily
Given: TypeAlias = Mapping[str, Sequence[SupportsFloat]]
Values: TypeAlias = Mapping[str, SupportsFloat]

#: Largest number of parameters with a range: the number of boxes grows exponentially with it.
MOST_MOVING = 3


def side(name: str, low: float, high: float) -> str:
    """Give the text of a range or a value."""
    return f"{name} {low:.6g}" if low == high else f"{name} {low:.6g} to {high:.6g}"


def ranges_of(given: Given) -> dict[str, Range]:
    """Ends of ranges by the names of their parameters."""
    if not isinstance(given, Mapping):
        raise TypeError(f"ranges={given!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if not given:
        raise ValueError("ranges of no parameter: give one to three")
    ends = {name: interval(name, value, may_be_point=True) for name, value in given.items()}
    if sum(low < high for low, high in ends.values()) > MOST_MOVING:
        raise ValueError(
            f"ranges for more than {MOST_MOVING} parameters ({', '.join(given)}): "
            "give the others values in at={...}"
        )
    return ends
