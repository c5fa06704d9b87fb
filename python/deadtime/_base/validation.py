"""Checks of single numbers, with messages that name the number and what to do."""

from __future__ import annotations

import math
import operator
import sys
from typing import Any, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "finite",
    "increasing",
    "non_negative",
    "non_zero",
    "one_dimensional",
    "positive",
    "real_array",
    "thread_number",
    "unmasked",
    "whole_number",
]


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
        raise ValueError(f"{name} is beyond 1e308: give a smaller number") from error
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
                f"{name}{where} is masked, there is no number to take: leave masked entries out, "
                "or fill them"
            )
        return values.data
    if isinstance(values, (list, tuple)):
        for index, value in enumerate(values):
            if isinstance(value, (list, tuple, np.ma.MaskedArray)):
                unmasked(f"{name}[{index}]", value)
    return values


def real_array(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return `values` as an array of floats, or raise where they are no real numbers."""
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    values = unmasked(name, values)
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} has rows of different lengths") from error
    if array.size and array.dtype.kind not in "biuf":
        raise TypeError(f"{name} of dtype {array.dtype}: give real numbers")
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
        raise ValueError(f"{name}={number}: give a whole number of at least {least}{otherwise}")
    return number


def one_dimensional(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """Return `given` as a vector of numbers, or raise; one number is a vector of one."""
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
        raise ValueError(f"{name} holds {times[~np.isfinite(times)][0]}: give finite times")
    steps = np.diff(times)
    if (steps <= 0.0).any():
        at = int(np.argmax(steps <= 0.0))
        raise ValueError(
            f"{name}[{at + 1}]={times[at + 1]} does not come after {name}[{at}]={times[at]}: give "
            "increasing times"
        )
    return times


def thread_number(threads: int | None) -> int | None:
    """Return `threads` as the native part takes it, or raise; it refuses zero and too many."""
    if threads is None:
        return None
    return whole_number("threads", threads, least=0, limit=2**31, otherwise=", or None")
