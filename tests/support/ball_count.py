"""Roots of quasi-polynomials counted in ball arithmetic, without any code of the package.

h(s) = Σ p_j(s) e^(−s τ_j) has as many roots in a polygon as the change of arg h along it, divided
by 2π. With a row c as reference, arg h = arg g − τ_c Im s, g = Σ p_j(s) e^(−s(τ_j−τ_c)). On a piece
with middle m and half length r, Taylor's formula gives |g − g(m)| ≤ |g′(m)| r + B r²/2, B a bound
on |g″| over the ball that covers the piece. Where that is below 0.9 |g(m)|, arg g stays within 65°
of arg g(m), so that the change between the ends is the principal one; elsewhere the piece is
divided. Everything is computed in python-flint's balls: nothing overflows, every rounding error is
bounded, and the precision is raised from 64 bits to 448 where a value is not known to 1 part in
100. Numbers given as floats are taken exactly. What cannot be decided raises an error.
"""

import math
from contextlib import contextmanager
from itertools import pairwise

import flint
from flint import acb, acb_poly, arb

PRECISIONS = (64, 112, 224, 448)

# Bits of corners and coefficients: products of few doubles are exact, or nearly so if their
# exponents differ much.
EXACT_BITS = 1200

# Bisections of one edge: many more than for a root at a distance of 1e-30 of its length.
DEEPEST = 160


class OnContourError(Exception):
    """A root is on the contour, or closer to it than the highest precision resolves."""

    def __init__(self, place):
        super().__init__(f"a root on the contour near {place}")
        self.place = place


class TooManyPiecesError(Exception):
    """The contour needs more pieces than were allowed."""


@contextmanager
def precision(bits):
    old, flint.ctx.prec = flint.ctx.prec, bits
    try:
        yield
    finally:
        flint.ctx.prec = old


def exact(number):
    """A float, an integer or a ball, as a ball."""
    return number if isinstance(number, arb) else arb(number)


def middle_of(z):
    return complex(float(z.real.mid()), float(z.imag.mid()))


class BallCounter:
    """Counts roots of h, given as rows of ascending coefficients and their delays."""

    def __init__(self, coefficients, delays, max_pieces=200_000):
        rows = [[float(c) for c in row] for row in coefficients]
        kept = [(row, float(tau)) for row, tau in zip(rows, delays, strict=True) if any(row)]
        if not kept:
            raise ValueError("the zero function")
        self.rows = [row for row, _ in kept]
        self.delays = [tau for _, tau in kept]
        self.max_pieces = max_pieces
        self.pieces = 0
        self._tables = {}

    # The function

    def _table(self, c):
        """For g = h e^(sτ_c): of each row p, p′ − dp, p″ − 2dp′ + d²p and −d, d = τ_j − τ_c."""
        if c not in self._tables:
            with precision(EXACT_BITS):
                table = []
                for row, tau in zip(self.rows, self.delays, strict=True):
                    d = arb(tau) - arb(self.delays[c])
                    p = acb_poly([arb(x) for x in row])
                    first = p.derivative()
                    table.append(
                        (p, first - d * p, first.derivative() - 2 * d * first + d * d * p, -d)
                    )
                self._tables[c] = table
        return self._tables[c]

    def leading_row(self, z):
        """The row with the largest term at `z`."""
        with precision(64):
            sizes = [(p(z) * (z * e).exp()).abs_upper() for p, _, _, e in self._table(0)]
            largest = 0
            for j, size in enumerate(sizes):
                if size > sizes[largest]:
                    largest = j
        return largest

    def value(self, z, c):
        total = acb(0)
        for p, _, _, e in self._table(c):
            total += p(z) * (z * e).exp()
        return total

    def _value_and_slope(self, z, c):
        value, slope = acb(0), acb(0)
        for p, q, _, e in self._table(c):
            factor = (z * e).exp()
            value += p(z) * factor
            slope += q(z) * factor
        return value, slope

    def _bend(self, hull, c):
        total = acb(0)
        for _, _, q, e in self._table(c):
            total += q(hull) * (hull * e).exp()
        return total.abs_upper()

    def _known(self, z, c, evaluate):
        """`evaluate` at the lowest precision that gives the value to 1 part in 100."""
        for bits in PRECISIONS:
            with precision(bits):
                found = evaluate(z, c)
                value = found[0] if isinstance(found, tuple) else found
                low, high = value.abs_lower(), value.abs_upper()
                if low > 0 and high < 1.01 * low:
                    return found
        raise OnContourError(middle_of(z))

    def condition(self, z):
        """Σ |b_jk s^k e^(−sτ_j)| over |h| at a complex number: how much the terms cancel."""
        z = acb(z.real, z.imag)
        with precision(PRECISIONS[-1]):
            size, total = z.abs_upper(), arb(0)
            for row, (_, _, _, e) in zip(self.rows, self._table(0), strict=True):
                moduli = sum((arb(abs(c)) * size**k for k, c in enumerate(row) if c), arb(0))
                total += moduli * (z * e).real.exp()
            return float((total / self.value(z, 0).abs_lower()).mid())

    # One edge

    def _turn(self, start, end):
        """Change of arg h from `start` to `end` along the straight line, as a ball."""
        with precision(EXACT_BITS):
            along = end - start
            points = {(0, 0): start, (1, 0): end}

        def point(t, k):
            while k and t % 2 == 0:
                t, k = t // 2, k - 1
            if (t, k) not in points:
                with precision(EXACT_BITS):
                    points[t, k] = start + along * (arb(t) * arb(2) ** -k)
            return points[t, k]

        turned = arb(0)
        c = self.leading_row(start)
        here = self._known(start, c, self.value)
        waiting = [(0, 1, 0)]
        while waiting:
            first, last, k = waiting.pop()
            self.pieces += 1
            if self.pieces > self.max_pieces:
                raise TooManyPiecesError(f"more than {self.max_pieces} pieces")
            if k > DEEPEST:
                raise OnContourError(middle_of(point(first, k)))
            a, b, m = point(first, k), point(last, k), point(first + last, k + 1)
            value, slope = self._known(m, c, self._value_and_slope)
            with precision(64):
                half = (b - a).abs_upper() / 2
                room = arb(0.9) * value.abs_lower()
                linear = slope.abs_upper() * half
                proved = linear < room
                if proved:
                    proved = linear + self._bend(a.union(b), c) * half * half / 2 < room
            if not proved:
                ratio = float((linear / room).mid())
                deeper = 1 if not ratio > 2 else min(4, math.ceil(math.log2(ratio)))
                parts = 2**deeper
                for i in reversed(range(parts)):
                    waiting.append((first * parts + i, first * parts + i + 1, k + deeper))
                continue
            there = self._known(b, c, self.value)
            with precision(128):
                turned += (there / here).arg() - exact(self.delays[c]) * (b - a).imag
            here = there
            leading = self.leading_row(b)
            if leading != c:
                c = leading
                here = self._known(b, c, self.value)
        return turned

    # Regions

    def _revolutions(self, turned, unit):
        number = (turned / unit).unique_fmpz()
        if number is None:
            raise TooManyPiecesError(f"the turns {turned} are no whole number of {unit}")
        return int(number)

    def polygon(self, corners):
        """Roots inside a polygon, its corners (complex, or pairs of balls) in positive order."""
        points = []
        for corner in corners:
            x, y = (corner.real, corner.imag) if isinstance(corner, complex) else corner
            points.append(acb(exact(x), exact(y)))
        with precision(128):
            turned = arb(0)
            for start, end in zip(points, points[1:] + points[:1], strict=True):
                turned += self._turn(start, end)
            return self._revolutions(turned, 2 * arb.pi())

    def rectangle(self, re, im):
        """Roots with Re s and Im s in the open ranges; uses symmetry to the real axis."""
        (a, b), (c, d) = map(exact, re), map(exact, im)
        if c + d != 0:
            return self.polygon([(a, c), (b, c), (b, d), (a, d)])
        zero = arb(0)
        corners = [acb(b, zero), acb(b, d), acb(a, d), acb(a, zero)]
        with precision(128):
            turned = arb(0)
            for start, end in pairwise(corners):
                turned += self._turn(start, end)
            return self._revolutions(turned, arb.pi())

    def upper_rectangle(self, re, height):
        """Roots with 0 ≤ Im s < `height`, including those on the real axis."""
        both, real = self.rectangle(re, (-height, height)), self.real(re)
        assert (both + real) % 2 == 0
        return (both + real) // 2

    def disc(self, center, radius, sides=4):
        """Roots inside the regular polygon with this number of sides around a disc."""
        with precision(EXACT_BITS):
            r = exact(radius)
            if sides == 4:
                x, y = arb(center.real), arb(center.imag)
                return self.polygon(
                    [(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)]
                )
            r = r / arb(math.cos(math.pi / sides)) * arb(1 + 1e-12)
            angles = [2 * math.pi * k / sides for k in range(sides)]
            corners = [
                (arb(center.real) + r * arb(math.cos(t)), arb(center.imag) + r * arb(math.sin(t)))
                for t in angles
            ]
        return self.polygon(corners)

    def right_of(self, sigma):
        """Roots with Re s > `sigma`, where the line is to the right of the chains."""
        radius = self.outermost(sigma)
        with precision(EXACT_BITS):
            if not (radius > exact(sigma)):
                return 0
        return self.rectangle((sigma, radius), (-radius, radius))

    def outermost(self, sigma):
        """A radius outside which h has no roots with Re s ≥ `sigma`.

        There |e^(−s(τ_j−τ_0))| ≤ w_j = e^(−σ(τ_j−τ_0)), so that none is left once
        |b_0n| − Σ_j w_j |b_jn| > Σ_{k<n} R^(k−n) Σ_j w_j |b_jk|, which is tried for R = 2^k.
        """
        with precision(128):
            first = min(range(len(self.delays)), key=self.delays.__getitem__)
            degree = max(k for row in self.rows for k, x in enumerate(row) if x)
            sums = [arb(0)] * (degree + 1)
            own = arb(0)
            for j, (row, tau) in enumerate(zip(self.rows, self.delays, strict=True)):
                weight = (-exact(sigma) * (arb(tau) - arb(self.delays[first]))).exp()
                for k, x in enumerate(row):
                    if j == first and k == degree:
                        own = arb(abs(x))
                    elif x:
                        sums[k] += weight * arb(abs(x))
            gap = own - sums[degree]
            if not (gap > 0):
                raise ValueError(f"the chains are not proved to lie left of {sigma}")
            for k in range(-1100, 1100):
                radius = arb(2) ** k
                if sum((sums[i] * radius ** (i - degree) for i in range(degree)), arb(0)) < gap:
                    return radius
        raise ValueError("no radius within the range of doubles")

    def real(self, re):
        """Real roots in an open interval whose ends are no roots; an error at multiple ones.

        An exact root at 0 is allowed: a power of s that all coefficients have in common.
        """
        zeros = min(k for row in self.rows for k, x in enumerate(row) if x)
        if zeros:
            rest = BallCounter([row[zeros:] for row in self.rows], self.delays, self.max_pieces)
            low, high = map(exact, re)
            return rest.real(re) + (zeros if low < 0 < high else 0)
        start, end = (acb(exact(x)) for x in re)
        number = 0
        waiting = [(start, end, 0)]
        while waiting:
            a, b, depth = waiting.pop()
            if depth > DEEPEST:
                raise OnContourError(middle_of(a))
            self.pieces += 1
            if self.pieces > self.max_pieces:
                raise TooManyPiecesError(f"more than {self.max_pieces} pieces")
            with precision(EXACT_BITS):
                # Not in the middle, where roots of symmetric cases often are.
                m = a + (b - a) * arb(27) / 64
            c = self.leading_row(m)
            with precision(PRECISIONS[-1]):
                value, slope = self._value_and_slope(m, c)
                reach = max((b - m).abs_upper(), (m - a).abs_upper())
                bend = self._bend(a.union(b), c) * reach
                if slope.abs_upper() * reach + bend * reach / 2 < value.abs_lower():
                    continue
                if bend < slope.abs_lower():
                    low, high = self.value(a, c).real, self.value(b, c).real
                    if low.contains(0) or high.contains(0):
                        raise OnContourError(middle_of(a))
                    number += bool((low > 0) != (high > 0))
                    continue
            waiting += [(a, m, depth + 1), (m, b, depth + 1)]
        return number
