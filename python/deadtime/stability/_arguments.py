"""Arguments of maps and boxes: axes, intervals of gains and delays, and how they are shown."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, SupportsFloat, TypeAlias, cast

from deadtime._base.arrays import Array
from deadtime._base.validation import Range, finite, interval, points_of

Given: TypeAlias = Mapping[str, Sequence[SupportsFloat]]

#: Largest number of parameters with a range: the number of boxes grows exponentially with it.
MOST_MOVING = 3

#: Upper limit on the number of cells (bounds memory and time).
_MAX_CELLS = 50_000_000


def side(name: str, low: float, high: float) -> str:
    """Give the text of a range or a value."""
    return f"{name} {low:.6g}" if low == high else f"{name} {low:.6g} to {high:.6g}"


def sides(axes: Mapping[str, Array]) -> str:
    """Give the text of the axes of a map."""
    return ", ".join(
        f"{name} {axis[0]:.6g} to {axis[-1]:.6g} ({len(axis)})" for name, axis in axes.items()
    )


def ranges_of(given: Given) -> dict[str, Range]:
    """Ends of ranges by the names of their parameters."""
    if not isinstance(given, Mapping):
        raise TypeError(f"ranges={given!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if not given:
        raise ValueError("ranges has no parameter: give one to three parameters")
    ends = {name: interval(name, value, may_be_point=True) for name, value in given.items()}
    if sum(low < high for low, high in ends.values()) > MOST_MOVING:
        raise ValueError(
            f"ranges of more than {MOST_MOVING} parameters ({', '.join(given)}) are given: for "
            "the other parameters, give a value in at={...}"
        )
    return ends


def map_axes(
    ranges: Mapping[str, Any], shape: Sequence[int], least: int = 2, most: float = _MAX_CELLS
) -> dict[str, Array]:
    """Points of the two axes by their names; `least` along each, and at `most` as many cells."""
    if not isinstance(ranges, Mapping):
        raise TypeError(f"ranges={ranges!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if len(ranges) != 2:
        raise ValueError(
            f"ranges of {len(ranges)} parameters ({', '.join(map(str, ranges))}) are given, "
            "but a map has two: give two ranges, and values of the other parameters in "
            "at={...}"
        )
    sizes = two_sizes("shape", shape, least)
    _refuse_more(sizes, most)
    axes = {
        name: points_of(name, given, size)
        for (name, given), size in zip(ranges.items(), sizes, strict=True)
    }
    _refuse_more(map(len, axes.values()), most)
    return axes


def two_sizes(name: str, given: Sequence[int], least: int) -> tuple[int, int]:
    """Numbers of points along two axes."""
    try:
        first, second = (operator.index(size) for size in given)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}={given!r}: give two whole numbers") from error
    if min(first, second) < least:
        raise ValueError(f"{name}={given!r}: give at least {least} points along each axis")
    return first, second


def _refuse_more(sizes: Iterable[int], most: float) -> None:
    cells = math.prod(sizes)
    if cells > most:
        raise ValueError(
            f"a map of {cells} cells is too large for a picture, which has at most {most} "
            "cells: take a smaller shape, or several maps of smaller ranges"
        )


def damping_demand(given: object) -> tuple[float, float] | None:
    if given is None:
        return None
    try:
        ratio, horizon = cast(Any, given)
    except (TypeError, ValueError) as error:
        raise TypeError(f"damping={given!r}: give (ratio, horizon), such as (0.4, 5.0)") from error
    return finite("damping ratio", ratio), finite("horizon of the damping", horizon)
