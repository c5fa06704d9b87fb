"""Ranges as arguments: ``(low, high)`` or ``(low, high, n)``, tuple and list alike.

An array, or a list of another length, holds the points themselves. `_ends_of` alone decides which
of the two a value is.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from typing import Any, SupportsFloat, SupportsIndex, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._base.validation import finite, real_array, unmasked

__all__ = [
    "OpenRange",
    "Points",
    "Range",
    "given_points",
    "interval",
    "is_range",
    "numbers_at",
    "open_interval",
    "points_of",
]

#: A range between two numbers.
Range: TypeAlias = tuple[float, float]

#: A range with None for an open end.
OpenRange: TypeAlias = tuple[float | None, float | None]

#: A range, with or without its number of points, or the points themselves.
Points: TypeAlias = (
    tuple[SupportsFloat, SupportsFloat]
    | tuple[SupportsFloat, SupportsFloat, SupportsIndex]
    | list[Any]
    | NDArray[Any]
)


def is_range(given: object) -> bool:
    """Whether `given` is a range: a tuple or a list of two or three entries that are no lists."""
    return (
        isinstance(given, (tuple, list))
        and len(given) in (2, 3)
        and not any(isinstance(one, (tuple, list, np.ndarray)) and np.ndim(one) for one in given)
    )


def interval(name: str, given: Any, *, may_be_point: bool = False) -> Range:
    """Return the two ends of a range, finite and increasing, or raise.

    Raises
    ------
    TypeError
        If `given` is no pair of numbers.
    ValueError
        If an end is not finite, the low end is not below the high one (`may_be_point` lets them
        be equal), or a number of points is given.
    """
    low, high, count = _ends_of(name, given)
    if count is not None:
        raise ValueError(f"{name}={given!r}: no points are taken here, give the range (low, high)")
    return _increasing(name, given, low, high, may_be_point)


def open_interval(name: str, given: Any) -> Range:
    """Return the two ends of a range, infinite where they are None; None is open on both sides."""
    if given is None:
        return -math.inf, math.inf
    given = unmasked(name, given)
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if not is_range(given) or len(given) != 2 or any(isinstance(one, str) for one in given):
        raise TypeError(f"{name}={given!r}: give a range (low, high), None for an open end")
    try:
        low, high = (
            default if end is None else float(end)
            for end, default in zip(given, (-math.inf, math.inf), strict=True)
        )
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"{name}={given!r}: give a range (low, high), None for an open end"
        ) from error
    return low, high


def given_points(name: str, given: Any, size: int | None = None) -> NDArray[np.float64]:
    """Return the points of a range, `size` of them where it does not say, or those given.

    Raises
    ------
    TypeError
        If the values are no real numbers.
    ValueError
        If a range is not increasing and finite, or has no number of points where `size` is None.
    """
    if not is_range(given):
        return np.array(real_array(name, given))
    low, high, count = _ends_of(name, given)
    low, high = _increasing(name, given, low, high, False)
    number = size if count is None else count
    if number is None:
        raise ValueError(
            f"{name}={given!r} is a range: say how many points it has, (low, high, n), or give the "
            "points as an array"
        )
    return np.linspace(low, high, number)


def points_of(name: str, given: Any, size: int) -> NDArray[np.float64]:
    """Return the points of an axis: those of a range, or the given ones, increasing and finite."""
    if not isinstance(given, (tuple, list, np.ndarray)) and np.ndim(given) == 0:
        raise TypeError(
            f"{name}={given!r}: give a range (low, high), or points as an array; a parameter with "
            "one value belongs in at={...}"
        )
    points = given_points(name, given, size)
    if points.ndim != 1 or points.size == 0:
        raise ValueError(f"{name} of shape {points.shape}: give one point or more in one dimension")
    if not np.isfinite(points).all():
        raise ValueError(f"{name}: not all points are finite")
    if not (np.diff(points) > 0.0).all():
        raise ValueError(f"{name}: points must increase; sort them and drop repeated ones")
    return points


def numbers_at(at: Mapping[str, SupportsFloat] | None, varied: Any = ()) -> dict[str, float]:
    """Return the values of the other parameters, which must not be among those `varied`.

    Raises
    ------
    TypeError
        If `at` is no mapping, or a value no number.
    ValueError
        If a value is not finite, or a parameter has a range as well.
    """
    if at is None:
        return {}
    if not isinstance(at, Mapping):
        raise TypeError(f"at={at!r}: give a dict such as {{'Kp': 2.0}}")
    for name in at:
        if name in varied:
            raise ValueError(
                f"{name} has a range and the value at={{{name!r}: {at[name]!r}}}: give one of them"
            )
    return {name: finite(name, value) for name, value in at.items()}


def _ends_of(name: str, given: Any) -> tuple[float, float, int | None]:
    """Return the ends of a range, and its number of points where it has one."""
    given = unmasked(name, given)
    if isinstance(given, np.ndarray) and given.shape == (2,):
        given = tuple(given.tolist())  # where no points are taken, two numbers are the ends
    if not is_range(given):
        raise TypeError(f"{name}={given!r}: give a range (low, high)")
    low, high = finite(name, given[0]), finite(name, given[1])
    if len(given) == 2:
        return low, high, None
    try:
        count = operator.index(given[2])
    except TypeError as error:
        raise TypeError(
            f"{name}={given!r}: three entries are a range (low, high, n) with a whole number n of "
            "points; give three points as an array, numpy.array([...])"
        ) from error
    if count < 2:
        raise ValueError(f"{name}={given!r}: a range (low, high, n) has at least n=2 points")
    return low, high, count


def _increasing(name: str, given: Any, low: float, high: float, may_be_point: bool) -> Range:
    if low > high or (low == high and not may_be_point):
        raise ValueError(f"{name}={given!r}: the low end of a range is below its high end")
    if math.isinf(high - low):
        raise ValueError(f"{name}={given!r}: the range is wider than 1e308")
    return low, high
