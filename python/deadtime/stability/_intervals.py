"""Intervals of gains and delays as arguments, and the order in which the core holds them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import SupportsFloat, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime import _deadtime
from deadtime._base.ranges import Range, interval
from deadtime.loops import ControlLoop
from deadtime.roots import ParametricQuasiPolynomial
from deadtime.roots._family import family_of

__all__ = [
    "MOST_MOVING",
    "Floats",
    "Given",
    "Progress",
    "Range",
    "System",
    "Values",
    "inverse",
    "native_family",
    "placed",
    "ranges_of",
    "side",
]

Floats: TypeAlias = NDArray[np.float64]
Progress: TypeAlias = Callable[[int], object]
System: TypeAlias = ParametricQuasiPolynomial | ControlLoop
Given: TypeAlias = Mapping[str, Sequence[SupportsFloat]]
Values: TypeAlias = Mapping[str, SupportsFloat]

#: Boxes are made of up to this many parameters.
MOST_MOVING = 3


def side(name: str, low: float, high: float) -> str:
    """One range, or value, as it is printed."""
    return f"{name} {low:.6g}" if low == high else f"{name} {low:.6g} to {high:.6g}"


def ranges_of(given: Given) -> tuple[tuple[str, ...], list[Range]]:
    """Names and ends of ranges."""
    if not isinstance(given, Mapping):
        raise TypeError(f"ranges={given!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if not given:
        raise ValueError("ranges of no parameter: give one to three")
    ends = [interval(name, value, may_be_point=True) for name, value in given.items()]
    if sum(low < high for low, high in ends) > MOST_MOVING:
        raise ValueError(
            f"ranges for more than {MOST_MOVING} parameters ({', '.join(given)}): "
            "give the others values in at={...}"
        )
    return tuple(given), ends


def native_family(
    system: System, names: tuple[str, ...], at: Values | None
) -> tuple[_deadtime.Family, list[int]]:
    """The family in the core, and where it holds each parameter."""
    family = family_of(system, names, at)
    return family._family, [family.names.index(name) for name in names]


def inverse(places: list[int]) -> list[int]:
    """The place among the names of each parameter of the family."""
    return [places.index(index) for index in range(len(places))]


def placed(ends: list[Range], places: list[int]) -> list[Range]:
    """The ranges in the order of the family."""
    return [ends[index] for index in inverse(places)]
