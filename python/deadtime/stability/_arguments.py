"""Arguments of maps and boxes: axes, intervals of gains and delays, and how they are shown."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
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
        raise ValueError("ranges of no parameter: give one to three")
    ends = {name: interval(name, value, may_be_point=True) for name, value in given.items()}
    if sum(low < high for low, high in ends.values()) > MOST_MOVING:
        raise ValueError(
            f"ranges for more than {MOST_MOVING} parameters ({', '.join(given)}): "
            "give the others values in at={...}"
        )
    return ends


def map_axes(ranges: Mapping[str, Any], shape: tuple[int, int]) -> dict[str, Array]:
    """Points of the two axes by their names."""
    if not isinstance(ranges, Mapping):
        raise TypeError(f"ranges={ranges!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if len(ranges) != 2:
        raise ValueError(
            f"ranges for {len(ranges)} parameters ({', '.join(map(str, ranges))}): a map has two"
        )
    axes = {
        name: points_of(name, given, size)
        for (name, given), size in zip(ranges.items(), _shape(shape), strict=True)
    }
    cells = math.prod(len(points) for points in axes.values())
    if cells > _MAX_CELLS:
        raise ValueError(
            f"{cells} cells: more than {_MAX_CELLS} are more than a picture holds; take a smaller "
            "shape, or several maps of smaller ranges"
        )
    return axes


def damping_demand(given: object) -> tuple[float, float] | None:
    if given is None:
        return None
    try:
        ratio, horizon = cast(Any, given)
    except (TypeError, ValueError) as error:
        raise TypeError(f"damping={given!r}: give (ratio, horizon), such as (0.4, 5.0)") from error
    return finite("damping ratio", ratio), finite("horizon of the damping", horizon)


def _shape(shape: Sequence[int]) -> tuple[int, int]:
    try:
        first, second = (operator.index(size) for size in shape)
    except (TypeError, ValueError) as error:
        raise TypeError(f"shape={shape!r}: give two whole numbers") from error
    if min(first, second) < 2:
        raise ValueError(f"shape={shape!r}: give at least 2 points a range")
    if first * second > _MAX_CELLS:
        raise ValueError(
            f"shape={shape!r}: more than {_MAX_CELLS} cells are more than a picture holds; take "
            "fewer, or several maps of smaller ranges"
        )
    return first, second
