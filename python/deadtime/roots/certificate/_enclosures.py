"""Exponential, cosine, sine and angle of exact numbers, enclosed in integer arithmetic.

A number is an integer n over a power of two: n / 2**q. Series are summed in fixed point with 16
guard bits. Every division rounds down, so the error of each term of a series is less than 3 units
of the last guard bit: its own two roundings and the error of the term before, which is reduced. A
series ends when a term vanishes; its remainder is less than 2 units. With the 3 units of the
reduced argument, the error of n terms is less than 3 n + 8 units. This uses integers only, no
floating point: it is slow, and independent of all other computations in this package.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from math import isqrt

_GUARD = 16

# Upper limits, as powers of two, on exponents and angles: no certificate has larger ones, because
# its weights are doubles, up to e^745.
_LARGEST_EXPONENT = 13
_LARGEST_ANGLE = 58


def dyadic(x: float | Fraction) -> tuple[int, int]:
    """Give (n, q) with x = n / 2**q exactly, q >= 0, for a multiple of a power of two."""
    numerator, denominator = x.as_integer_ratio()
    return numerator, denominator.bit_length() - 1


def whole(rows: Sequence[Sequence[Fraction]]) -> tuple[list[list[int]], int]:
    """Rows of multiples of powers of two as integers over one power 2**q, and the least such q."""
    q = max(dyadic(x)[1] for row in rows for x in row)
    return [[scaled(x, q) for x in row] for row in rows], q


def scaled(x: Fraction, q: int) -> int:
    """A multiple of 2**-q, times 2**q."""
    n, remainder = divmod(x.numerator << q, x.denominator)
    if remainder:
        raise ValueError(f"{x} is not a multiple of 2**-{q}")
    return n


def shifted(n: int, left: int) -> int:
    """Multiply by 2**left, rounding down."""
    return n << left if left >= 0 else n >> -left


def _inverse_series(x: int, bits: int, sign: int) -> int:
    """Sum x^-(2k+1) sign^k / (2k+1): arctangent (sign -1) or artanh (sign 1) of 1/x."""
    power = (1 << bits) // x
    total, k, square = 0, 0, x * x
    while power:
        total += (sign if k % 2 else 1) * (power // (2 * k + 1))
        power //= square
        k += 1
    return total


@lru_cache(maxsize=32)
def pi(bits: int) -> int:
    """Pi times 2**bits, within 1 (Machin 1706: 16 atan 1/5 - 4 atan 1/239)."""
    guarded = bits + _GUARD
    value = 16 * _inverse_series(5, guarded, -1) - 4 * _inverse_series(239, guarded, -1)
    return value >> _GUARD


@lru_cache(maxsize=32)
def _ln2(bits: int) -> int:
    """Natural logarithm of 2 times 2**bits, within 1 (2 artanh 1/3)."""
    return (2 * _inverse_series(3, bits + _GUARD, 1)) >> _GUARD


@lru_cache(maxsize=4096)
def exponential(n: int, q: int, bits: int) -> tuple[int, int, int]:
    """Enclose e^(n / 2**q).

    Returns
    -------
    low, high, shift : int
        low / 2**shift <= e^(n / 2**q) <= high / 2**shift, of about `bits` binary digits.
    """
    if abs(n) >> q >= 1 << _LARGEST_EXPONENT:
        if n > 0:
            raise OverflowError("an exponential is larger than in any certificate")
        return 0, 1, 1 << _LARGEST_EXPONENT
    work = bits + _GUARD
    t = shifted(n, work - q)
    ln2 = _ln2(work + 32)
    k = ((t << 33) + ln2) // (2 * ln2)
    r = t - ((k * ln2) >> 32)
    total = term = 1 << work
    count = 0
    while term:
        count += 1
        term = ((term * r) >> work) // count
        total += term
    error = 3 * count + 8
    return total - error, total + error, work - k


def exponential_between(x: Fraction, bits: int) -> tuple[Fraction, Fraction]:
    """Enclose e^x for a multiple x of a power of two, by numbers of about `bits` binary digits."""
    low, high, shift = exponential(*dyadic(x), bits)
    unit = Fraction(2) ** -shift
    return low * unit, high * unit


@lru_cache(maxsize=4096)
def cos_sin(n: int, q: int, bits: int) -> tuple[int, int]:
    """Cosine and sine of n / 2**q times 2**bits, each within 2."""
    if abs(n) >> q >= 1 << _LARGEST_ANGLE:
        raise OverflowError("an angle is larger than in any certificate")
    work = bits + _GUARD
    t = shifted(n, work - q)
    half_pi = pi(work + 64)
    quarter = ((t << 66) + half_pi) // (2 * half_pi)
    r = t - ((quarter * half_pi) >> 65)
    square = (r * r) >> work
    sums = []
    for term, start in ((1 << work, 0), (r, 1)):
        total, k = term, start
        while term:
            term = -((term * square) >> work) // ((k + 1) * (k + 2))
            k += 2
            total += term
        sums.append(total >> _GUARD)
    cosine, sine = sums
    return ((cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine))[quarter % 4]


def angle(x: int, y: int) -> int:
    """Angle of the vector (x, y), not zero, in (-pi, pi], times 2**64, within 8.

    Two halvings, t -> t / (1 + sqrt(1 + t^2)), then the series of the arctangent.
    """
    work = 96
    unity = 1 << work
    large, small = max(abs(x), abs(y)), min(abs(x), abs(y))
    t = (small << work) // large
    for _ in range(2):
        t = (t << work) // (unity + isqrt(unity * unity + t * t))
    square = (t * t) >> work
    total, power, k = 0, t, 0
    while power:
        total += (-1 if k % 2 else 1) * (power // (2 * k + 1))
        power = (power * square) >> work
        k += 1
    total *= 4
    if abs(y) > abs(x):
        total = pi(work - 1) - total
    if x < 0:
        total = pi(work) - total
    return (-total if y < 0 else total) >> (work - 64)
