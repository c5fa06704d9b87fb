"""Checks of single numbers, with messages that name the number and what to do."""

from __future__ import annotations

import math
from typing import SupportsFloat

__all__ = ["finite", "non_negative", "non_zero", "positive"]


def finite(name: str, value: SupportsFloat) -> float:
    """Return `value` as a finite float, or raise."""
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}={value!r} is not a number: give a real number") from error
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
