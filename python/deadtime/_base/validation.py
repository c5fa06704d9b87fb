"""Checks of arguments: numbers, arrays and ranges, with messages that say what to do.

A range is ``(low, high)`` or ``(low, high, n)``, tuple and list alike; an array, or a list of
another length, holds the points themselves. `_ends_of` alone decides which of the two a value is.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Mapping
from typing import Any, SupportsFloat, SupportsIndex, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

_FLOAT = np.dtype(np.float64)

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


def finite(name: str, value: SupportsFloat) -> float:
    """Return `value` as a finite float, or raise."""
    if type(value) is float and math.isfinite(value):
        return value
    value = unmasked(name, value)
    try:
        if isinstance(value, (str, bytes)):  # text that float() would read is still no number
            raise TypeError
        number = float(value)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}={value!r} is not a number: give a real number") from error
    except OverflowError as error:  # a whole number beyond the range of doubles
        raise ValueError(
            f"{name} is beyond 1e308, the largest number in double precision: give a smaller number"
        ) from error
    if not math.isfinite(number):
        raise ValueError(f"{name}={number}: give a finite number")
    return number


def non_negative(name: str, value: SupportsFloat) -> float:
    """Return `value` as a float that is zero or more, or raise."""
    number = finite(name, value)
    if number < 0.0:
        raise ValueError(f"{name}={number} is negative: give zero or more")
    return number


def positive(name: str, value: SupportsFloat) -> float:
    """Return `value` as a float above zero, or raise."""
    number = finite(name, value)
    if number <= 0.0:
        raise ValueError(f"{name}={number}: give a number above zero")
    return number


def confidence(level: float) -> float:
    """Return the level of an interval, which is between 0 and 1, or raise."""
    if not 0.0 < level < 1.0:
        raise ValueError(f"level={level!r} is not between 0 and 1: give a level such as 0.95")
    return level


def non_zero(name: str, value: SupportsFloat, reason: str) -> float:
    """Return `value` as a float other than zero, or raise with the `reason` why it cannot be."""
    number = finite(name, value)
    if number == 0.0:
        raise ValueError(f"{name}=0: {reason}; give a number other than zero")
    return number


def unmasked(name: str, values: Any) -> Any:
    """Return `values` without the mask of a masked array, or raise where one of them is masked.

    NumPy drops the mask as it makes an array of them, and what was under it counts.
    """
    if type(values) is np.ndarray or "numpy.ma" not in sys.modules:
        return values  # without numpy.ma there are no masked arrays, and it is slow to load
    if isinstance(values, np.ma.MaskedArray):
        masked = np.argwhere(np.ma.getmaskarray(values))
        if masked.size or values is np.ma.masked:
            where = f"[{', '.join(map(str, masked[0]))}]" if values.ndim else ""
            raise ValueError(
                f"{name}{where} is masked, so its value is missing: leave masked entries out, or "
                "fill them"
            )
        return values.data
    if isinstance(values, (list, tuple)):
        for index, value in enumerate(values):
            if isinstance(value, (list, tuple, np.ma.MaskedArray)):
                unmasked(f"{name}[{index}]", value)
    return values


def real_array(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return `values` as an array of floats, or raise where they are no real numbers."""
    if type(values) is np.ndarray and (values.dtype is _FLOAT or values.dtype == _FLOAT):
        return values
    values = unmasked(name, values)
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(
            f"{name} has rows of different lengths: give rows of one length"
        ) from error
    if array.size and array.dtype.kind not in "biuf":
        raise TypeError(f"{name} has the dtype {array.dtype}: give real numbers")
    return array.astype(np.float64, copy=False)


def whole_number(
    name: str,
    value: SupportsIndex,
    *,
    least: int = 1,
    limit: int = 2**40,
    otherwise: str = "",
) -> int:
    """Return `value` as an integer of at least `least` and below `limit`, or raise."""
    try:
        number = operator.index(value)
    except TypeError as error:
        raise TypeError(f"{name}={value!r}: give a whole number{otherwise}") from error
    if not least <= number < limit:
        bound = f"at least {least}" if number < least else f"at most {limit - 1}"
        raise ValueError(f"{name}={number}: give a whole number of {bound}{otherwise}")
    return number


def one_dimensional(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """Return `given` as a vector of numbers, or raise; one number is a vector of one."""
    if type(given) is np.ndarray and given.dtype is _FLOAT and given.ndim == 1:
        return given
    array = real_array(name, given)
    if array.ndim == 1:
        return array
    if array.ndim == 0:
        return array.reshape(1)
    raise ValueError(f"{name} has shape {array.shape}: give a one-dimensional array")


def increasing(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """Return `given` as a vector of finite times that increase, or raise."""
    times = one_dimensional(name, given)
    if not np.isfinite(times).all():
        raise ValueError(f"{name} contains {times[~np.isfinite(times)][0]}: give finite times")
    steps = np.diff(times)
    if (steps <= 0.0).any():
        at = int(np.argmax(steps <= 0.0))
        raise ValueError(
            f"{name}[{at + 1}]={times[at + 1]} is not later than {name}[{at}]={times[at]}: give "
            "increasing times"
        )
    return times


def thread_number(threads: int | None) -> int | None:
    """Return `threads` as the native part takes it, or raise; it refuses zero and too many."""
    if threads is None:
        return None
    return whole_number("threads", threads, least=0, limit=2**31, otherwise=", or None")


def is_range(given: object) -> bool:
    """Whether `given` is a range: a tuple or a list of two or three entries that are no lists."""
    return (
        isinstance(given, (tuple, list))
        and len(given) in (2, 3)
        and not any(isinstance(end, (tuple, list, np.ndarray)) and np.ndim(end) for end in given)
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
        raise ValueError(
            f"{name}={given!r}: here only the two ends of the range are possible, so give "
            "(low, high)"
        )
    return _increasing(name, given, low, high, may_be_point)


def open_interval(name: str, given: Any) -> Range:
    """Return the two ends of a range, infinite where they are None; None is open on both sides."""
    if given is None:
        return -math.inf, math.inf
    given = unmasked(name, given)
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if not is_range(given) or len(given) != 2 or any(isinstance(end, str) for end in given):
        raise TypeError(f"{name}={given!r}: give a range (low, high). For an open end, give None")
    try:
        low, high = (
            default if end is None else float(end)
            for end, default in zip(given, (-math.inf, math.inf), strict=True)
        )
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"{name}={given!r}: give a range (low, high). For an open end, give None"
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
            f"{name}={given!r} does not say how many points the range has: give (low, high, "
            "n), or the points as an array"
        )
    return np.linspace(low, high, number)


def points_of(name: str, given: Any, size: int) -> NDArray[np.float64]:
    """Return the points of an axis: those of a range, or the given ones, increasing and finite."""
    if not isinstance(given, (tuple, list, np.ndarray)) and np.ndim(given) == 0:
        raise TypeError(
            f"{name}={given!r}: give a range (low, high), or points as an array. If the parameter "
            "has only one value, give this value in at={...}"
        )
    points = given_points(name, given, size)
    if points.ndim != 1 or points.size == 0:
        raise ValueError(
            f"{name} has shape {points.shape}: give a one-dimensional array with at least one point"
        )
    if not np.isfinite(points).all():
        raise ValueError(f"{name} contains a point that is not finite: give finite numbers")
    if not (np.diff(points) > 0.0).all():
        raise ValueError(
            f"the points of {name} do not increase: sort the points, and remove repeated ones"
        )
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
                f"{name} has a range, and also a value in at={{{name!r}: {at[name]!r}}}: give "
                "only the range or only the value"
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
            f"{name}={given!r}: three entries mean a range (low, high, n) of n points, so the "
            "third entry must be a whole number. For three points, give numpy.array([...])"
        ) from error
    if count < 2:
        raise ValueError(
            f"{name}={given!r}: in a range (low, high, n), n is the number of points. Give n=2 "
            "or more"
        )
    return low, high, count


def _increasing(name: str, given: Any, low: float, high: float, may_be_point: bool) -> Range:
    if low > high or (low == high and not may_be_point):
        raise ValueError(f"{name}={given!r}: give a range whose low end is below its high end")
    if math.isinf(high - low):
        raise ValueError(f"{name}={given!r}: this range is wider than 1e308. Give a narrower range")
    return low, high
