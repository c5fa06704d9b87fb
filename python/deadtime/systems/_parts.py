"""Numerator and denominator of a transfer function, read from what was given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, TypeAlias, cast

from numpy.typing import ArrayLike, NDArray

from deadtime._base.validation import real_array
from deadtime.roots import QuasiPolynomial, is_number

Polynomial: TypeAlias = QuasiPolynomial | float | Sequence[float] | NDArray[Any]


def quasi_polynomial(name: str, given: Polynomial) -> QuasiPolynomial:
    """Give what was given as a quasi-polynomial."""
    if isinstance(given, QuasiPolynomial):
        return given
    if is_number(given):
        return QuasiPolynomial([[float(cast(float, given))]], [0.0])
    descending = real_array(name, cast(ArrayLike, given))
    if descending.ndim != 1 or descending.size == 0:
        raise ValueError(
            f"{name} has shape {descending.shape}: give a QuasiPolynomial, a number, or the "
            "coefficients in descending powers of s"
        )
    return QuasiPolynomial(descending[None, ::-1], [0.0])


def without_common_delay(
    n: QuasiPolynomial, d: QuasiPolynomial
) -> tuple[QuasiPolynomial, QuasiPolynomial]:
    """Cancel the smallest delay, unless rounding would change another one."""
    both = [h for h in (n, d) if h.coefficients.any()]
    smallest = float(min(h.delays[0] for h in both))
    times = [float(tau) for h in both for tau in h.delays]
    if smallest == 0.0 or any(math.fsum((t, -smallest, -(t - smallest))) for t in times):
        return n, d
    n, d = (
        QuasiPolynomial(h.coefficients, h.delays - smallest) if h.coefficients.any() else h
        for h in (n, d)
    )
    return n, d


def without_common_powers(
    first: QuasiPolynomial, second: QuasiPolynomial
) -> tuple[QuasiPolynomial, QuasiPolynomial]:
    """Divide both by the highest power of s that divides every row of both exactly."""
    k = min(first._native.powers_of_s(), second._native.powers_of_s())
    first, second = (QuasiPolynomial._wrap(h._native.without_powers(k)) for h in (first, second))
    return first, second


def without_common_factor(
    num: QuasiPolynomial, den: QuasiPolynomial
) -> tuple[QuasiPolynomial, QuasiPolynomial]:
    """Divide both by the greatest polynomial that divides every row of both.

    Computed in integers, by Euclid's algorithm. If a quotient is no double, nothing is divided.
    """
    rows = [_whole(row) for h in (num, den) for row in h.coefficients]
    factor: _Whole = []
    for row, _ in rows:
        factor = _greatest_divisor(factor, row)
    if factor[-1] < 0:
        factor = [-number for number in factor]
    if len(factor) < 2:
        return num, den
    quotients = [
        [Fraction(number) / unit for number in _divided(row, factor)[0]] for row, unit in rows
    ]
    if any(_rounded(number) != number for row in quotients for number in row):
        return num, den
    width = max(map(len, quotients))
    table = [[float(number) for number in row] + [0.0] * (width - len(row)) for row in quotients]
    first = len(num.delays)
    return QuasiPolynomial(table[:first], num.delays), QuasiPolynomial(table[first:], den.delays)


#: A polynomial with integer coefficients, in ascending powers; the last one is not zero.
_Whole: TypeAlias = list[int]


def _whole(row: NDArray[Any]) -> tuple[_Whole, int]:
    """Integer coefficients, and the power of two that was multiplied to them."""
    numbers = [Fraction(float(number)) for number in row]
    unit = max(number.denominator for number in numbers)
    return _trimmed([int(number * unit) for number in numbers]), unit


def _trimmed(polynomial: _Whole) -> _Whole:
    while polynomial and polynomial[-1] == 0:
        polynomial = polynomial[:-1]
    return polynomial


def _divided(dividend: _Whole, divisor: _Whole) -> tuple[_Whole, _Whole]:
    """Quotient and remainder, of the dividend times a whole number where division needs one."""
    rest, quotient = list(dividend), [0] * max(len(dividend) - len(divisor) + 1, 0)
    for at in reversed(range(len(quotient))):
        top = rest[at + len(divisor) - 1]
        if top % divisor[-1]:
            scale = abs(divisor[-1]) // math.gcd(top, divisor[-1])
            rest, quotient = [scale * n for n in rest], [scale * n for n in quotient]
            top *= scale
        quotient[at] = top // divisor[-1]
        for k, number in enumerate(divisor):
            rest[at + k] -= quotient[at] * number
    return quotient, _trimmed(rest)


def _greatest_divisor(a: _Whole, b: _Whole) -> _Whole:
    """Greatest common divisor, its coefficients without a common factor."""
    while b:
        a, b = b, _divided(a, b)[1]
        common = math.gcd(*b)
        b = [number // common for number in b]
    common = math.gcd(*a)
    return [number // common for number in a]


def _rounded(number: Fraction) -> Fraction | None:
    """Give the double next to a number; None where it is too large."""
    try:
        return Fraction(float(number))
    except OverflowError:
        return None
