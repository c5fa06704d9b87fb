"""Arguments of maps: the two axes, and what is asked of the cells."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from deadtime._base.validation import finite, points_of

__all__ = ["damping_demand", "map_axes"]

_Floats: TypeAlias = NDArray[np.float64]

#: Upper limit on the number of cells (bounds memory and time).
_MAX_CELLS = 50_000_000


def map_axes(
    ranges: Mapping[str, Any], shape: tuple[int, int]
) -> tuple[tuple[str, str], dict[str, _Floats]]:
    """Names and points of the two axes."""
    if not isinstance(ranges, Mapping):
        raise TypeError(f"ranges={ranges!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if len(ranges) != 2:
        raise ValueError(
            f"ranges for {len(ranges)} parameters ({', '.join(map(str, ranges))}): a map has two"
        )
    first, second = ranges
    sizes = _shape(shape)
    axes = {
        name: points_of(name, ranges[name], size)
        for name, size in zip((first, second), sizes, strict=True)
    }
    cells = math.prod(len(points) for points in axes.values())
    if cells > _MAX_CELLS:
        raise ValueError(
            f"{cells} cells: more than {_MAX_CELLS} are more than a picture holds; take a smaller "
            "shape, or several maps of smaller ranges"
        )
    return (first, second), axes


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
