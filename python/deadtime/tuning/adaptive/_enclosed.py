"""Numbers between two fractions: the arithmetic in which a form is checked.

Sums, differences, products and quotients of two enclosed numbers enclose the exact ones. Ends are
rounded outwards to multiples of 2**-DIGITS, so that they do not grow in digits.
"""

from __future__ import annotations

from fractions import Fraction

from deadtime.roots.certificate import exponential_between

#: Binary digits after the point to which ends are rounded: more take longer, fewer leave errors
#: that a form has to bear.
DIGITS = 120


class Enclosed:
    """A number of which only bounds are known."""

    __slots__ = ("high", "low")

    def __init__(self, low: Fraction | float, high: Fraction | float | None = None) -> None:
        self.low = _down(Fraction(low))
        self.high = -_down(-Fraction(low if high is None else high))

    def __add__(self, other: Enclosed) -> Enclosed:
        return Enclosed(self.low + other.low, self.high + other.high)

    def __sub__(self, other: Enclosed) -> Enclosed:
        return Enclosed(self.low - other.high, self.high - other.low)

    def __mul__(self, other: Enclosed) -> Enclosed:
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Enclosed(min(ends), max(ends))

    def __truediv__(self, other: Enclosed) -> Enclosed:
        if other.low <= 0 <= other.high:
            raise ZeroDivisionError("the divisor may be zero")
        return self * Enclosed(1 / other.high, 1 / other.low)

    @property
    def middle(self) -> Fraction:
        """A multiple of 2**-(DIGITS + 1)."""
        return (self.low + self.high) / 2

    @property
    def radius(self) -> Fraction:
        """The largest distance from the middle."""
        return (self.high - self.low) / 2


def exponential_of(exponent: Enclosed) -> Enclosed:
    """Enclose e to the power of an enclosed number, which is a multiple of 2**-DIGITS."""
    low, _ = exponential_between(exponent.low, DIGITS)
    _, high = exponential_between(exponent.high, DIGITS)
    return Enclosed(low, high)


def _down(x: Fraction) -> Fraction:
    return Fraction((x.numerator << DIGITS) // x.denominator, 1 << DIGITS)
