"""The function of a certificate in exact numbers: enclosures of its values, bounds on derivatives.

Coefficients, delays and points are doubles, which are integers over powers of two: polynomials are
evaluated without any rounding, and exponentials are enclosed in fixed point. The slope in a disc is
bounded by a bound on the second derivative; close to several roots, where the higher derivatives
are much smaller than the moduli of their terms, by the Taylor polynomial at the middle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import NoReturn, TypeAlias

from deadtime._base.errors import CertificateError
from deadtime.roots.certificate._enclosures import (
    cos_sin,
    dyadic,
    exponential,
    exponential_between,
    shifted,
    whole,
)

# Binary digits of a value, in relation to its size: more take longer, fewer refuse true claims
# close to a root. Doubles have 53.
_DIGITS = 120

# Binary digits of enclosures for inequalities with a wide margin.
_FEW = 128

# Order of Taylor polynomials close to several roots: a higher one gives sharper bounds and takes
# longer.
_ORDER = 8

# Upper limit on the digits (bounds the time): a value that needs more is refused.
_MOST_DIGITS = 1 << 14

# Upper limit on the binary digits of all powers of a point together, one power for each
# coefficient, and the same for Taylor polynomials, which are fractions (they bound the time).
_MOST_WORK = 1 << 24
_MOST_WORK_WITH_FRACTIONS = 1 << 20


_Exact: TypeAlias = tuple[Fraction, Fraction]


class ExactFunction:
    """2^scale h(s) / s^zeros in integers.

    The integers ``rows`` are divided by 2^q and ``delays`` by 2^t; ``rows_exact`` and
    ``delays_exact`` are the same numbers as fractions.
    """

    def __init__(
        self,
        coefficients: Sequence[Sequence[float]],
        delays: Sequence[float],
        scale: int,
        zeros: int,
    ) -> None:
        rows = [_trimmed(row, zeros) for row in coefficients]
        if len(rows) != len(delays) or not rows:
            fail("the numbers of coefficient rows and of delays differ")
        factor = Fraction(2) ** scale
        exact = [[Fraction(c) * factor for c in row] for row in rows]
        self.rows_exact = exact
        self.rows, self.q = whole(exact)
        self.delays_exact = [Fraction(tau) for tau in delays]
        if any(not a < b for a, b in pairwise(self.delays_exact)) or any(
            tau < 0 for tau in self.delays_exact
        ):
            fail("its delays are negative or do not increase")
        (self.delays,), self.t = whole([self.delays_exact])

    def enclose(self, s: complex, index: int, size: float) -> Enclosure:
        """Enclose g and g' at s, with enough digits for values of about `size`."""
        (x, qx), (y, qy) = dyadic(s.real), dyadic(s.imag)
        q = max(qx, qy)
        affordable(self.rows, Fraction(1, 1 << q), above(*map(abs, pair(s))))
        x, y = x << (q - qx), y << (q - qy)
        polynomials = []
        largest = 0
        for row in self.rows:
            pr = pi_ = dr = di = 0
            for power, c in enumerate(reversed(row)):
                dr, di = dr * x - di * y + pr, dr * y + di * x + pi_
                pr, pi_ = pr * x - pi_ * y + (c << (q * power)), pr * y + pi_ * x
            shift = self.q + q * (len(row) - 1)
            polynomials.append((pr, pi_, dr, di, shift))
            largest = max(
                largest,
                (abs(pr) + abs(pi_)).bit_length() - shift,
                (abs(dr) + abs(di)).bit_length() - shift + q,
            )
        gaps = [tau - self.delays[index] for tau in self.delays]
        widest = max(map(abs, gaps)).bit_length() - self.t
        bits = _DIGITS - math.frexp(size)[1] + max(0, largest) + max(0, widest)
        if bits > _MOST_DIGITS:
            raise OverflowError(f"checking a value takes {bits} binary digits, which is too many")
        bits = max(128, -(-bits // 64) * 64)
        found = Enclosure(bits)
        for (pr, pi_, dr, di, shift), gap in zip(polynomials, gaps, strict=True):
            tr, ti, error = self._factor(gap, x, y, q, bits)
            vr, vi = (pr * tr - pi_ * ti) >> shift, (pr * ti + pi_ * tr) >> shift
            lost = (((abs(pr) + abs(pi_)) * error) >> shift) + 2
            shift -= q
            wr = shifted(dr * tr - di * ti, -shift) - ((gap * vr) >> self.t)
            wi = shifted(dr * ti + di * tr, -shift) - ((gap * vi) >> self.t)
            worse = shifted((abs(dr) + abs(di)) * error, -shift)
            found.add(vr, vi, lost, wr, wi, worse + ((abs(gap) * lost) >> self.t) + 5)
        return found

    def _factor(self, gap: int, x: int, y: int, q: int, bits: int) -> tuple[int, int, int]:
        """Real and imaginary part of e^(-s gap) times 2**bits, and a bound on their errors."""
        low, high, shift = exponential(-gap * x, self.t + q, bits)
        low, high = shifted(low, bits - shift), shifted(high, bits - shift) + 1
        cosine, sine = cos_sin(gap * y, self.t + q, bits)
        # Errors of the exponential, of cosine and sine (2 units each), and of the product.
        error = high - low + ((high * 2) >> bits) + 2
        return (low * cosine) >> bits, -((low * sine) >> bits), error

    def bend(self, middle: complex, radius: Fraction, index: int) -> Fraction:
        """Bound |g''| in a disc by moduli of coefficients, rounding only |s| and exponentials."""
        x, y = pair(middle)
        reach = above(abs(x), abs(y)) + radius
        # The largest |s| in the disc, rounded up to 100 binary digits.
        size = reach.numerator.bit_length() - reach.denominator.bit_length()
        q = max(0, 100 - size)
        n = _ceil(reach, q)
        total = Fraction(0)
        for row, tau in zip(self.rows, self.delays, strict=True):
            p = dp = ddp = 0
            for power, c in enumerate(reversed(row)):
                ddp = ddp * n + dp
                dp = dp * n + p
                p = p * n + (abs(c) << (q * power))
            gap = abs(tau - self.delays[index])
            # All three terms are divided by 2^(q degree + 2 t), and by the 2^self.q of the
            # coefficients.
            curved = (ddp << (2 * q + 2 * self.t + 1)) + (gap * dp << (q + self.t + 1))
            curved += gap * gap * p
            exponent = Fraction(gap, 1 << self.t) * radius
            exponent -= Fraction(tau - self.delays[index], 1 << self.t) * x
            below = self.q + q * (len(row) - 1) + 2 * self.t
            total += Fraction(curved, 1 << below) * exponential_above(exponent)
        return total

    def steepness(self, middle: complex, radius: Fraction, index: int, size: float) -> Fraction:
        """Bound |g'| in a disc by the Taylor polynomial of g, for values of about `size`."""
        affordable(self.rows, *map(abs, pair(middle)), limit=_MOST_WORK_WITH_FRACTIONS)
        # |g'| <= sum k |a_k| r^(k - 1) + (n + 1) R r^n, R bounding the coefficient a_(n + 1).
        total = (_ORDER + 1) * self._taylor_rest(middle, radius, index)
        for k, bound in reversed(list(enumerate(self._taylor(middle, radius, index, size)))[1:]):
            total = total * radius + k * bound
        return total

    def _taylor(self, middle: complex, radius: Fraction, index: int, size: float) -> list[Fraction]:
        """Bounds on the moduli of the Taylor coefficients of g up to the order `_ORDER`."""
        x, y = pair(middle)
        (nx, qx), (ny, qy) = dyadic(middle.real), dyadic(middle.imag)
        q = max(qx, qy)
        nx, ny = nx << (q - qx), ny << (q - qy)
        terms = []
        largest = 0
        for j, row in enumerate(self.rows_exact):
            gap = self.delays_exact[j] - self.delays_exact[index]
            polynomial = _expanded(_moved(row, x, y, _ORDER), gap)
            terms.append((j, polynomial))
            # Integer digits of the terms on the boundary of the disc.
            spread = max((abs(a) + abs(b)) * radius**k for k, (a, b) in enumerate(polynomial))
            spread *= exponential_above(-gap * x) if gap * x < 0 else 1
            largest = max(largest, (spread.numerator // spread.denominator).bit_length())
        bits = min(_DIGITS + 64 - math.frexp(size)[1] + largest, _MOST_DIGITS)
        bits = max(128, -(-bits // 64) * 64)
        sums = [(Fraction(0), Fraction(0), Fraction(0))] * (_ORDER + 1)
        for j, polynomial in terms:
            parts = self._factor(self.delays[j] - self.delays[index], nx, ny, q, bits)
            tr, ti, error = (Fraction(part, 1 << bits) for part in parts)
            for k, (a, b) in enumerate(polynomial):
                re, im, lost = sums[k]
                more = (abs(a) + abs(b)) * error
                sums[k] = (re + a * tr - b * ti, im + a * ti + b * tr, lost + more)
        return [above(abs(re), abs(im)) + 2 * lost for re, im, lost in sums]

    def _taylor_rest(self, middle: complex, radius: Fraction, index: int) -> Fraction:
        """Bound on the Taylor coefficient of order `_ORDER` + 1 at every point of a disc."""
        x, y = pair(middle)
        reach = above(abs(x), abs(y)) + radius
        digits = max(0, 100 + reach.denominator.bit_length() - reach.numerator.bit_length())
        reach = Fraction(_ceil(reach, digits), 1 << digits)
        total = Fraction(0)
        for row, tau in zip(self.rows_exact, self.delays_exact, strict=True):
            gap = tau - self.delays_exact[index]
            moved = _moved([abs(c) for c in row], reach, Fraction(0), _ORDER + 1)
            # With -|gap| in place of the gap all terms are positive.
            bound, _ = _expanded(moved, -abs(gap), _ORDER + 1)[-1]
            total += bound * exponential_above(abs(gap) * radius - gap * x)
        return total


class Enclosure:
    """g = vr + i vi and g' = wr + i wi at a point in units of 2**-bits.

    `lost` bounds the error of each part of g, `worse` that of g'.
    """

    __slots__ = ("bits", "lost", "vi", "vr", "wi", "worse", "wr")

    def __init__(self, bits: int) -> None:
        self.bits = bits
        self.vr = self.vi = self.wr = self.wi = 0
        self.lost = self.worse = 0

    def add(self, vr: int, vi: int, lost: int, wr: int, wi: int, worse: int) -> None:
        """Add a term and its errors."""
        self.vr, self.vi, self.wr, self.wi = self.vr + vr, self.vi + vi, self.wr + wr, self.wi + wi
        self.lost, self.worse = self.lost + lost, self.worse + worse

    def is_within(self, center: tuple[Fraction, Fraction], radius: Fraction) -> bool:
        """Whether g is proved to be within `radius` of `center`."""
        unit = Fraction(1, 1 << self.bits)
        allowed = radius - 2 * self.lost * unit
        difference = (self.vr * unit - center[0], self.vi * unit - center[1])
        return allowed >= 0 and difference[0] ** 2 + difference[1] ** 2 <= allowed**2

    def slope_above(self) -> Fraction:
        """Upper bound on |g'|."""
        size = math.isqrt(self.wr**2 + self.wi**2) + 1 + 2 * self.worse
        return Fraction(size, 1 << self.bits)


def _moved(row: Sequence[Fraction], x: Fraction, y: Fraction, order: int) -> list[_Exact]:
    """Coefficients of p(s + t) in powers of t, s = x + iy, by repeated synthetic division."""
    values = [(Fraction(c), Fraction(0)) for c in row]
    for lowest in range(min(len(row), order + 1)):
        a, b = Fraction(0), Fraction(0)
        for i in range(len(row) - 1, lowest - 1, -1):
            a, b = values[i] = a * x - b * y + values[i][0], a * y + b * x + values[i][1]
    return values[: order + 1]


def _expanded(moved: list[_Exact], gap: Fraction, order: int = _ORDER) -> list[_Exact]:
    """Taylor coefficients of p(s + t) e^(-gap t)."""
    powers = [Fraction(1)]
    for k in range(1, order + 1):
        powers.append(-powers[-1] * gap / k)
    found = []
    for k in range(order + 1):
        pairs = list(zip(moved, reversed(powers[: k + 1]), strict=False))
        found.append((sum(a * c for (a, _), c in pairs), sum(b * c for (_, b), c in pairs)))
    return [(Fraction(a), Fraction(b)) for a, b in found]


def fail(message: str) -> NoReturn:
    raise CertificateError(f"the certificate is false: {message}")


def _trimmed(row: Sequence[float], zeros: int) -> list[float]:
    """A row divided by s^zeros, without trailing zeros."""
    if any(row[:zeros]):
        fail(f"the function cannot be divided by s^{zeros}")
    kept = list(row[zeros:])
    while kept and kept[-1] == 0:
        kept.pop()
    if not kept:
        fail("a row of coefficients contains only zeros")
    return kept


def pair(value: complex) -> tuple[Fraction, Fraction]:
    return Fraction(value.real), Fraction(value.imag)


def affordable(
    rows: Sequence[Sequence[object]], *points: Fraction, limit: int = _MOST_WORK
) -> None:
    """Refuse points whose powers in the polynomials have too many digits."""
    digits = sum(point.numerator.bit_length() + point.denominator.bit_length() for point in points)
    work = digits * max(map(len, rows)) * sum(map(len, rows))
    if work > limit:
        raise OverflowError(
            f"checking the polynomials takes {work} binary digits, which is too many"
        )


def _ceil(x: Fraction, bits: int) -> int:
    return -((-x.numerator << bits) // x.denominator)


def above(x: Fraction, y: Fraction) -> Fraction:
    """Upper bound on the length of (x, y), too large by less than 2^-100 of it or 2^-1200."""
    largest = max(x, y)
    if largest == 0:
        return largest
    bits = 110 + max(0, largest.denominator.bit_length() - largest.numerator.bit_length())
    a, b = _ceil(x, bits), _ceil(y, bits)
    return Fraction(math.isqrt(a * a + b * b) + 1, 1 << bits)


def exponential_above(x: Fraction) -> Fraction:
    return exponential_between(x, _FEW)[1]
