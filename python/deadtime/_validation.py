"""Checks of single numbers, with messages that name the number and what to do."""

from __future__ import annotations

import math
import operator
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "finite",
    "increasing",
    "non_negative",
    "non_zero",
    "positive",
    "real_array",
    "thread_number",
]


def finite(name: str, value: SupportsFloat) -> float:
    """Return `value` as a finite float, or raise."""
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


def non_zero(name: str, value: SupportsFloat) -> float:
    """Return `value` as a float other than zero, or raise."""
    number = finite(name, value)
    if number == 0.0:
        raise ValueError(f"{name}=0: the loop is open without it, give a number other than zero")
    return number


def real_array(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return `values` as an array of floats, or raise where they are no real numbers."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name} has rows of different lengths") from error
    if array.size and array.dtype.kind not in "biuf":
        raise TypeError(f"{name} of dtype {array.dtype}: give real numbers")
    return array.astype(np.float64, copy=False)


def increasing(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """Return `given` as a vector of finite times that increase, or raise."""
    times = np.atleast_1d(real_array(name, given))
    if times.ndim != 1:
        raise ValueError(f"{name} has shape {times.shape}: give a one-dimensional array")
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
    try:
        number = operator.index(threads)
    except TypeError as error:
        raise TypeError(f"threads={threads!r}: give a whole number, or None") from error
    if not 0 <= number < 2**31:
        raise ValueError(f"threads={number}: give a whole number of at least 1, or None")
    return number
