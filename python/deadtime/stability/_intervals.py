"""Intervals of gains and delays as arguments."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import SupportsFloat, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._base.validation import finite
from deadtime.loops import ControlLoop
from deadtime.roots import ParametricQuasiPolynomial

__all__ = [
    "MOST_MOVING",
    "Floats",
    "Given",
    "Progress",
    "Range",
    "System",
    "ranges_of",
    "side",
]

Floats: TypeAlias = NDArray[np.float64]
Progress: TypeAlias = Callable[[int], object]
Range: TypeAlias = tuple[float, float]
System: TypeAlias = ParametricQuasiPolynomial | ControlLoop
Given: TypeAlias = Mapping[str, tuple[SupportsFloat, SupportsFloat] | SupportsFloat]

#: Boxes are made of up to this many parameters.
MOST_MOVING = 3


def side(name: str, low: float, high: float) -> str:
    """One range, or value, as it is printed."""
    return f"{name} {low:.6g}" if low == high else f"{name} {low:.6g} to {high:.6g}"


def ranges_of(given: Given) -> dict[str, Range]:
    """Ends of ranges and values."""
    if not isinstance(given, Mapping):
        raise TypeError(f"ranges={given!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if not given:
        raise ValueError("ranges of no parameter: give one to three")
    ends = {}
    for name, value in given.items():
        if isinstance(value, (tuple, list, np.ndarray)):
            if len(value) != 2:
                raise ValueError(f"{name}={value!r}: a range is (low, high)")
            low, high = (finite(name, end) for end in value)
            if low > high:
                raise ValueError(
                    f"{name}={value!r}: the low end of a range is not above its high end"
                )
            if math.isinf(high - low):
                raise ValueError(f"{name}={value!r}: the range is wider than 1e308")
        else:
            low = high = finite(name, value)
        ends[name] = (low, high)
    if sum(low < high for low, high in ends.values()) > MOST_MOVING:
        raise ValueError(
            f"ranges for more than {MOST_MOVING} parameters ({', '.join(given)}): "
            "give the others values"
        )
    return ends
