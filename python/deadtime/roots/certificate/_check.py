"""Independent check of certificates with exact numbers, without any code of the prover.

Every claim of a certificate is checked:

1. the parts removed from an open region contain no root (`_check_closing`);
2. the paths go around the closed region without a gap (`_check_path`);
3. along each segment g = h e^(s tau_c) stays in the disc about the stated value: the value at the
   middle is enclosed, and the slope is bounded in the disc about it (`_check_segment`);
4. the argument of g then changes by less than pi from one value to the next, so the changes can be
   summed exactly; where tau_c changes and at the ends, g is enclosed as well; the sum is an integer
   multiple of pi (`_turns`);
5. on the real axis, if it is an edge, the signs of g determine the roots (`_real_roots`).

Polynomials with the given coefficients and points (doubles are exact numbers) are evaluated without
any rounding, exponentials are enclosed in fixed point (`_enclosures`), and inequalities are decided
between integers or fractions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise

from deadtime.roots.certificate._enclosures import angle, pi
from deadtime.roots.certificate._form import check_form
from deadtime.roots.certificate._function import (
    ExactFunction,
    above,
    affordable,
    exponential_above,
    fail,
    pair,
)
from deadtime.roots.certificate._parts import Contour, Monotone, Proof, Segment
from deadtime.roots.certificate._stored import refusing


def check(certificate: Proof) -> int:
    """Verify all claims of a certificate and return its count.

    Raises
    ------
    CertificateError
        If a claim is false; the message names the first one.
    """
    with refusing("certificate"):
        check_form(certificate)
        return _Checker(certificate).count()


class _Checker:
    """The function of a certificate in integers, and the claims about it."""

    def __init__(self, certificate: Proof) -> None:
        self.certificate = certificate
        self.function = ExactFunction(
            certificate.coefficients, certificate.delays, certificate.scale, certificate.zeros
        )

    # All claims, and the count

    def count(self) -> int:
        """Verify all claims and return the number of roots."""
        claimed = self.certificate
        (a, b), (c, d) = claimed.region
        if not (a < b and c < d and a < math.inf and b > -math.inf):
            fail(f"its region {claimed.region} has a range that does not increase")
        total = self._zeros()
        re, im = self._check_closing()
        expected = []
        if re[0] < re[1] and im[0] < im[1]:
            if im[0] <= 0:
                height = im[1] if im[0] == 0 else -im[0]
                expected.append((re, (0.0, height), True))
                if height < im[1]:
                    expected.append((re, (height, im[1]), False))
            else:
                expected.append((re, im, False))
        given = [(contour.re, contour.im, contour.symmetric) for contour in claimed.contours]
        if given != expected:
            fail(f"its paths go around {given}, but they must go around {expected}")
        for contour in claimed.contours:
            number = self._turns(contour)
            if number != contour.count:
                fail(
                    f"along a path the function turns {number} times, but the certificate states "
                    f"{contour.count}"
                )
            if contour.symmetric and im[0] == 0:
                real = self._real_roots(contour.re)
                if number < real or (number - real) % 2:
                    fail(
                        f"{real} of {number} roots are real, so the other roots cannot be "
                        "complex pairs"
                    )
                number = real + (number - real) // 2
            total += number
        if total != claimed.count:
            fail(f"it proves {total} roots, but it states {claimed.count}")
        return total

    def _zeros(self) -> int:
        """Number of exact roots at 0 in the region."""
        zeros = self.certificate.zeros
        (a, b), (c, d) = self.certificate.region
        if zeros < 0:
            fail(f"it states {zeros} roots at 0")
        if zeros == 0 or a > 0 or b < 0 or c > 0 or d < 0:
            return 0
        if a == 0 or b == 0:
            fail("the function has a root at 0, on the edge of the region")
        return zeros

    # 1: open sides of the region

    def _check_closing(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Verify that no root is outside the closed region; return its ranges."""
        claimed = self.certificate
        (a, b), (c, d) = claimed.region
        if c + d < 0:
            c, d = -d, -c
        re, im = claimed.closed
        if not all(map(math.isfinite, (*re, *im))):
            fail("the region with a proved contour has an infinite side")
        radius = math.inf
        if math.isinf(c) or math.isinf(d):
            if claimed.beyond is None:
                fail(
                    "the region is open in the imaginary part, but the certificate gives no "
                    "bound for roots far away"
                )
            row, radius = claimed.beyond
            self._check_dominance(row, radius, (a, b))
        height = max(abs(im[0]), abs(im[1]))
        left = re[0] == a or a < re[0] <= -radius
        left = left or (a == -math.inf and self._is_left_edge(re[0], height))
        right = re[1] == b or b > re[1] >= radius
        right = right or (b == math.inf and self._is_right_edge(re[1], height))
        lower = im[0] == c or c < im[0] <= -radius
        upper = im[1] == d or d > im[1] >= radius
        if not (left and right and lower and upper):
            fail(
                f"roots of the region {claimed.region} may lie outside the closed region "
                f"{claimed.closed}"
            )
        return re, im

    def _check_dominance(self, index: int, radius: float, re: tuple[float, float]) -> None:
        """Verify that one leading term exceeds the others in a strip where |s| >= radius.

        Divided by |s|^n the others decrease with |s|, so it is enough to check |s| = radius.
        """
        degree = max(map(len, self.function.rows)) - 1
        if not (0 <= index < len(self.function.rows) and 0 <= radius < math.inf):
            fail("its bound for roots far away is not valid")
        if len(self.function.rows[index]) != degree + 1:
            fail("the row that should dominate far away does not have the highest degree")
        excess = abs(self.function.rows_exact[index][degree])
        lower = [Fraction(0)] * degree
        for j, row in enumerate(self.function.rows_exact):
            gap = self.function.delays_exact[j] - self.function.delays_exact[index]
            if gap == 0:
                weight = Fraction(1)
            else:
                edge = re[0] if gap > 0 else re[1]
                if math.isinf(edge):
                    fail(
                        "the region is open to one side, and no term of the function dominates "
                        "there"
                    )
                weight = exponential_above(-gap * Fraction(edge))
            for k, c in enumerate(row):
                if k < degree:
                    lower[k] += weight * abs(c)
                elif j != index:
                    excess -= weight * abs(c)
        r = Fraction(radius)
        affordable(self.function.rows, r)
        # With radius 0 the whole strip is excluded, which only a constant allows.
        positive = radius > 0 or degree == 0
        if not positive or excess * r**degree <= sum(c * r**k for k, c in enumerate(lower)):
            fail(f"roots with |s| above {radius} are not excluded")

    def _is_right_edge(self, x: float, height: float) -> bool:
        return _dominates_rightward(self.function.rows_exact, self.function.delays_exact, x, height)

    def _is_left_edge(self, x: float, height: float) -> bool:
        """As `_is_right_edge`, for h(-s) e^(-s tau_last); its coefficients have the same moduli."""
        rows, last = self.function.rows_exact[::-1], self.function.delays_exact[-1]
        delays = [last - tau for tau in reversed(self.function.delays_exact)]
        return _dominates_rightward(rows, delays, -x, height)

    # 2: paths

    def _check_path(self, contour: Contour) -> None:
        """Verify that the segments go around the rectangle, each from the end of the one before."""
        (a, b), (c, d) = contour.re, contour.im
        corners = [complex(b, c), complex(b, d), complex(a, d), complex(a, c)]
        if not contour.symmetric:
            corners = [complex(a, c), *corners]
        segments = iter(contour.segments)
        for start, end in pairwise(corners):
            here = start
            while here != end:
                segment = next(segments, None)
                if segment is None:
                    fail(f"a path ends at {here}, before its last corner")
                if segment.start != here:
                    fail(f"a path has a gap between {here} and {segment.start}")
                here = segment.end
                if not _is_on_line(segment.start, here, end):
                    fail(f"a path leaves the edge of its rectangle at {here}")
        if next(segments, None) is not None:
            fail("a path continues after its last corner")

    # 3: segments

    def _check_segment(self, segment: Segment) -> None:
        """Verify that g stays in the disc of radius error + slope r about `value`, and 0 is not."""
        if not 0 <= segment.reference < len(self.function.rows):
            fail(f"a segment refers to delay number {segment.reference}, which does not exist")
        if not (segment.error >= 0 and segment.slope >= 0):
            fail("a segment has a negative bound")
        where = f"between {segment.start} and {segment.end}"
        radius = _radius(segment.start, segment.middle, segment.end)
        value = pair(segment.value)
        spread = Fraction(segment.error) + Fraction(segment.slope) * radius
        if not spread**2 < value[0] ** 2 + value[1] ** 2:
            fail(f"the function may be zero {where}")
        # The enclosure needs more digits if the slope times r is to be compared with the value.
        size = abs(segment.value) / max(1.0, float(radius))
        found = self.function.enclose(segment.middle, segment.reference, size)
        if not found.is_within(value, Fraction(segment.error)):
            fail(f"the function at {segment.middle}, {where}, differs from the stated value")
        bend = self.function.bend(segment.middle, radius, segment.reference)
        steepest = found.slope_above() + bend * radius
        claimed = Fraction(segment.slope)
        if steepest > claimed:
            # A sharper bound, for segments close to several roots.
            steepest = self.function.steepness(segment.middle, radius, segment.reference, size)
        if steepest > claimed:
            fail(f"the slope of the function can exceed the stated slope {where}")

    # 4: turns

    def _turns(self, contour: Contour) -> int:
        """Verify a contour and return its number of roots, by the change of argument of h."""
        self._check_path(contour)
        half_turns = 0
        # In units of 2^-64 rad.
        total, slack = Fraction(0), 0
        for leg in _legs(contour.segments):
            for segment in leg:
                self._check_segment(segment)
            first, last = leg[0], leg[-1]
            ends = [
                self._clear_end(first.start, first),
                self._clear_end(last.end, last),
            ]
            values = [ends[0], *(pair(segment.value) for segment in leg), ends[1]]
            for before, after in pairwise(values):
                half_turns += 2 * _crossing(before, after)
            angles = [_angle(value) for value in ends]
            rise = Fraction(last.end.imag) - Fraction(first.start.imag)
            total += angles[1] - angles[0]
            total -= self.function.delays_exact[first.reference] * rise * (1 << 64)
            # The value at an end has a relative error of 2^-20, its angle an error of 8 units.
            slack += 2 * ((1 << 45) + 8)
        turn = pi(64)
        number = half_turns + round(total / turn)
        off = abs(total - (number - half_turns) * turn) + abs(number - half_turns) + slack
        if off >= turn // 4:
            fail("along a path the function does not turn a whole number of times")
        unit = 1 if contour.symmetric else 2
        if number < 0 or number % unit:
            fail(
                f"along a path the function turns {number} half turns, which is not a possible "
                "number of roots"
            )
        return number // unit

    def _clear_end(self, place: complex, segment: Segment) -> tuple[Fraction, Fraction]:
        """Enclose g where a leg begins or ends, with a relative error of 2^-20."""
        found = self.function.enclose(place, segment.reference, abs(segment.value))
        if found.lost << 20 > max(abs(found.vr), abs(found.vi)):
            fail(f"the function may be zero at {place}")
        unit = Fraction(1, 1 << found.bits)
        return found.vr * unit, found.vi * unit

    # 5: the real axis

    def _real_roots(self, re: tuple[float, float]) -> int:
        """Verify the parts of the real axis and return the number of real roots."""
        total = 0
        here = re[0]
        for part in self.certificate.real:
            start, end = part.start.real, part.end.real
            if start != here or not start < end:
                fail(f"the segments of the real axis have a gap between {here} and {start}")
            if isinstance(part, Monotone):
                total += self._check_monotone(part)
            else:
                if part.start.imag or part.end.imag or part.middle.imag:
                    fail("a segment of the real axis does not lie on the real axis")
                if not start <= part.middle.real <= end:
                    fail("the middle of a segment lies outside the segment")
                self._check_segment(part)
            here = end
        if here != re[1]:
            fail(f"the real axis is not covered right of {here}")
        return total

    def _check_monotone(self, part: Monotone) -> int:
        """Verify that g' keeps its sign on a part; return its number of roots, 0 or 1."""
        if not 0 <= part.reference < len(self.function.rows) or not (
            part.error >= 0 and part.bend >= 0
        ):
            fail("the bounds of a segment of the real axis are negative, or belong to no term")
        start, end, middle = map(Fraction, (part.start, part.end, part.middle))
        radius = max(end - middle, middle - start)
        slope, error, bend = map(Fraction, (part.slope, part.error, part.bend))
        if not error + bend * radius < abs(slope) or not start <= middle <= end:
            fail(
                f"between {part.start} and {part.end} the slope of the function may change its sign"
            )
        found = self.function.enclose(complex(part.middle), part.reference, abs(part.slope))
        unit = Fraction(1, 1 << found.bits)
        if abs(found.wr * unit - slope) + found.worse * unit > error:
            fail(f"the slope of the function at {part.middle} differs from the stated slope")
        if self.function.bend(complex(part.middle), radius, part.reference) > bend:
            fail(
                f"the curvature of the function near {part.middle} can exceed the stated curvature"
            )
        signs = set()
        for end_point in (part.start, part.end):
            found = self.function.enclose(
                complex(end_point), part.reference, abs(part.slope) * 1e-9
            )
            if abs(found.vr) <= found.lost:
                fail(f"the function may be zero at {end_point}")
            signs.add(found.vr > 0)
        return len(signs) - 1


def _dominates_rightward(
    rows: list[list[Fraction]], delays: list[Fraction], x: float, height: float
) -> bool:
    """Whether the first row's leading term exceeds all others for Re s >= x, |Im s| <= height.

    Divided by (Re s)^n every other term decreases with Re s: without a delay everywhere, with a
    delay and s^k from Re s = (k - n)/delay on.
    """
    if not x > 0:
        return False
    edge = Fraction(x)
    size = above(edge, Fraction(height))
    affordable(rows, size)
    degree = len(rows[0]) - 1
    total = Fraction(0)
    for row, tau in zip(rows, delays, strict=True):
        gap = tau - delays[0]
        if gap > 0 and edge * gap < len(row) - 1 - degree:
            return False
        weight = exponential_above(-gap * edge)
        for k, c in enumerate(row):
            if gap > 0 or k < degree:
                total += weight * abs(c) * size**k
    return total < abs(rows[0][degree]) * edge**degree


def _is_on_line(start: complex, end: complex, corner: complex) -> bool:
    """Whether `end` lies on the straight line from `start` to `corner`."""
    if start.imag == end.imag == corner.imag:
        a, b, c = start.real, end.real, corner.real
    elif start.real == end.real == corner.real:
        a, b, c = start.imag, end.imag, corner.imag
    else:
        return False
    return a < b <= c or a > b >= c


def _radius(start: complex, middle: complex, end: complex) -> Fraction:
    """Largest distance of the ends from the middle, which must lie on the line between them."""
    if start.imag == middle.imag == end.imag:
        a, m, b = start.real, middle.real, end.real
    elif start.real == middle.real == end.real:
        a, m, b = start.imag, middle.imag, end.imag
    else:
        fail(f"the middle of the segment from {start} to {end} does not lie on the segment")
    return max(abs(Fraction(m) - Fraction(a)), abs(Fraction(b) - Fraction(m)))


def _legs(segments: Iterable[Segment]) -> list[list[Segment]]:
    """Groups of successive segments with the same reference."""
    legs: list[list[Segment]] = []
    for segment in segments:
        if legs and legs[-1][-1].reference == segment.reference:
            legs[-1].append(segment)
        else:
            legs.append([segment])
    return legs


def _crossing(a: tuple[Fraction, Fraction], b: tuple[Fraction, Fraction]) -> int:
    """Crossing of the negative real axis by a turn of less than pi from a to b: 1, 0 or -1."""
    if (a[1] >= 0) == (b[1] >= 0):
        return 0
    cross = a[0] * b[1] - a[1] * b[0]
    if a[1] >= 0:
        return 1 if cross > 0 else 0
    return -1 if cross < 0 else 0


def _angle(value: tuple[Fraction, Fraction]) -> int:
    x, y = value
    common = x.denominator * y.denominator
    return angle(int(x * common), int(y * common))
