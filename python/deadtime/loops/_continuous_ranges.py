"""The range of one number of a continuous loop: up to the nearest crossings of the imaginary axis.

A delay: its crossings come in closed form, see `_axis_crossings`. Most other numbers are a factor k
in h = A + k B, which has roots on the axis only where Im(A conj B) = 0; `zeros_between` misses no
such frequency up to a radius that no unstable root exceeds while k is in a range, and the ranges
grow until there is a crossing. Where B leads, one radius holds for all k beyond a value: that of
mu A + B, mu = 1/k. Without delay Im(A conj B) is a polynomial, and all its zeros are known at once.

The corner p of a filter g = s^2 + 2 d p s + p^2 enters as h = A + p B + p^2 C. Real p that solve it
on the axis exist only where the resultant of the real and the imaginary part vanishes,

    Im(A conj C)^2 - Im(A conj B) Im(B conj C) = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from deadtime.roots import ParametricQuasiPolynomial, QuasiPolynomial, delay, s
from deadtime.roots._axis_crossings import chain_free, leading, periods, rows_of
from deadtime.roots._frequency import RealFunction, ratio_rows, without_common_power, zeros_between

__all__ = ["range_of_corner", "range_of_damping", "range_of_delay", "range_of_gain"]

_Range: TypeAlias = tuple[float, float]
_Rows: TypeAlias = dict[float, NDArray[np.complex128]]

#: The first range of a gain is this part of its value, the following ones reach so much farther.
_FIRST, _GROWTH = 0.25, 4.0

#: Ranges of a gain that are looked at: from a quarter of the value to 1e11 times it.
_RANGES = 20

#: A number that has no meaning at zero is followed down to this part of its value.
_NEARLY_ZERO = 1e-6

#: Imaginary part of a number that is real, as a part of it: double roots have the root of the
#: rounding.
_REAL = 1e-6

#: Part of the way to where chains of roots reach the axis that is searched for all crossings.
_BEFORE_CHAINS = 0.99

#: Halvings between a stable value and the one at which chains of roots reach the axis.
_HALVINGS = 60


def range_of_delay(family: ParametricQuasiPolynomial, value: float) -> _Range:
    """Around `value`, at which the loop is stable; `family` has no parameter but the delay."""
    rows = rows_of(family, "delay")
    lead, rest = leading(rows, "delay", 0.0, 2.0 * value + 1.0)
    if lead <= rest:
        return value, value
    _, first, period, _ = periods(rows, "delay")
    if not first.size:
        return 0.0, math.inf
    low = first + period * (np.ceil((value - first) / period) - 1.0)
    high = first + period * (np.floor((value - first) / period) + 1.0)
    return max(0.0, float(low[low < value].max(initial=0.0))), float(high[high > value].min())


def range_of_gain(
    family: ParametricQuasiPolynomial, name: str, value: float, bounds: _Range
) -> _Range:
    """Around `value`, within `bounds`; `family` has no other parameter than `name`.

    Raises
    ------
    ValueError
        If the end of a range is neither found nor ruled out.
    """
    if name not in {q for powers, _, _ in family._terms for q, _ in powers}:
        return bounds
    down = _end(family, name, value, -1.0, bounds[0])
    return down + 0.0, _end(family, name, value, 1.0, bounds[1]) + 0.0


def _end(
    family: ParametricQuasiPolynomial, name: str, value: float, sign: float, last: float
) -> float:
    a, b = _parts(family, name)[:2]
    for found in _without_end(a, b, value, sign):
        known = _nearest(found, value, sign)
        return max(known, last) if sign < 0.0 else min(known, last)
    if value == last:
        return last
    size = abs(value) if value != 0.0 else 1.0
    if last == 0.0:
        last = -sign * _NEARLY_ZERO * size
    width = _FIRST * size
    for _ in range(_RANGES):
        reach = value + sign * width
        if sign * (last - reach) <= 0.0:
            reach = last
        free = chain_free(family, name, value, reach)
        stop = value + _BEFORE_CHAINS * (free - value) if free != reach else reach
        if stop != value:
            nearest = _nearest(_gains(a, b, _highest(a, b, (value, stop))), value, sign)
            if sign * (stop - nearest) >= 0.0:
                return nearest
        if free != reach:
            return _before_chains(family, name, stop, free)
        if reach == last:
            return 0.0 if abs(last) <= _NEARLY_ZERO * size else last
        width *= _GROWTH
    raise ValueError(
        f"the loop is stable from {name}={value:g} to {reach:g}, and nothing beyond is ruled out"
    )


def _nearest(found: NDArray[np.float64], value: float, sign: float) -> float:
    beyond = found[sign * (found - value) > 0.0]
    return float(beyond[np.argmin(np.abs(beyond - value))]) if beyond.size else sign * math.inf


def _without_end(
    a: QuasiPolynomial, b: QuasiPolynomial, value: float, sign: float
) -> Iterator[NDArray[np.float64]]:
    """All crossings there are from `value` on, where one search finds them; else nothing."""
    if len({*a.delays, *b.delays}) == 1:
        # Without delay there is no more than a polynomial.
        found = _gains(a, b, math.inf)
        if a.degree == b.degree:
            found = np.append(found, -a.coefficients[0, -1] / b.coefficients[0, -1])
        yield found
    elif sign * value > 0.0 and b.degree >= a.degree:
        # B + mu A, mu from zero to 1/value; beyond zero the sign of the number changes.
        try:
            highest = _highest(b, a, (0.0, 1.0 / value))
        except ValueError:
            return
        found = _gains(a, b, highest)
        yield np.append(found[found * value > 0.0], 0.0)


def _highest(a: QuasiPolynomial, b: QuasiPolynomial, ends: _Range) -> float:
    """A radius that no root of a + k b with Re s >= 0 exceeds, k between `ends` (Fujiwara)."""
    first = min(a.delays[0], b.delays[0])
    degree = max(a.degree, b.degree)
    sizes, lead = np.zeros(degree + 1), 0.0
    for tau in np.union1d(a.delays, b.delays):
        rows = np.zeros((2, degree + 1))
        for row, h in zip(rows, (a, b), strict=True):
            for late, coefficients in zip(h.delays, h.coefficients, strict=True):
                if late == tau:
                    row[: len(coefficients)] += coefficients
        reached = [rows[0] + end * rows[1] for end in ends]
        if tau == first:
            same = reached[0][degree] * reached[1][degree] > 0.0
            lead = min(abs(one[degree]) for one in reached) if same else 0.0
            sizes[:degree] += np.max(np.abs(reached), axis=0)[:degree]
        else:
            sizes += np.max(np.abs(reached), axis=0)
    excess = lead * (1.0 - 1e-12) - sizes[degree]
    if excess <= 0.0:
        raise ValueError("the leading coefficient does not outweigh the later ones of that power")
    ratios = (sizes[:degree] / excess) ** (1.0 / (degree - np.arange(degree)))
    return float(2.0 * ratios.max(initial=0.0))


def _last_zero(rows: _Rows) -> float:
    """Bound on the zeros of Im(sum of C e^(-j omega delay)), where the term without delay leads."""
    own = {late: np.abs(row if late != 0.0 else row.imag) for late, row in rows.items()}
    degree = max((int(size.nonzero()[0].max(initial=0)) for size in own.values()), default=0)
    sizes, lead = np.zeros(degree + 1), 0.0
    for late, size in own.items():
        part = size[: degree + 1]
        sizes[: len(part)] += part
        if late == 0.0 and len(part) == degree + 1:
            lead = float(part[degree])
    excess = 2.0 * lead * (1.0 - 1e-12) - sizes[degree]
    if excess <= 0.0:
        return math.inf
    ratios = (sizes[:degree] / excess) ** (1.0 / (degree - np.arange(degree)))
    return float(2.0 * ratios.max(initial=0.0))


def _gains(a: QuasiPolynomial, b: QuasiPolynomial, highest: float) -> NDArray[np.float64]:
    """Every k for which a + k b has a root on the axis up to a frequency, and k for one at zero."""
    rows = without_common_power(ratio_rows(a, b, 0))
    highest = min(highest, _last_zero(rows))
    omega = zeros_between(RealFunction(rows), 0.0, highest) if highest > 0.0 else np.zeros(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        at_zero = -a.coefficients[:, 0].sum() / b.coefficients[:, 0].sum()
        found = np.append(at_zero, -np.real(a(1j * omega) / b(1j * omega)))
    return np.asarray(found[np.isfinite(found)])


def _before_chains(
    family: ParametricQuasiPolynomial, name: str, stable: float, free: float
) -> float:
    """Halve the last thousandth before chains of roots reach the axis."""
    if not family.at(**{name: stable}).is_stable():
        return stable
    end = free - 1e-9 * (free - stable)
    if family.at(**{name: end}).is_stable():
        return free
    for _ in range(_HALVINGS):
        middle = 0.5 * (stable + end)
        if family.at(**{name: middle}).is_stable():
            stable = middle
        else:
            end = middle
    return stable


def range_of_damping(
    family: ParametricQuasiPolynomial, value: float, highest: float | None
) -> _Range:
    """Around the damping `value` of a filter; `highest` ends the frequencies for all above it."""
    down = _end(family, "damping", value, -1.0, 0.0)
    if highest is None:
        return down, _end(family, "damping", value, 1.0, math.inf)
    a, b, _ = _parts(family, "damping")
    if not b.coefficients.any():
        return 0.0, math.inf
    return down, _nearest(_gains(a, b, highest), value, 1.0)


def range_of_corner(
    family: ParametricQuasiPolynomial, value: float, highest: float | None
) -> _Range:
    """Around the corner `value` of a filter; `highest` ends the frequencies for any corner."""
    a, b, c = _parts(family, "omega")
    if not c.coefficients.any():
        return 0.0, math.inf
    if highest is None:
        raise ValueError(
            "the loop gain does not stay below one at high frequencies for every corner of the "
            "filter: the range of its corner is known where it does"
        )
    ac, ab, bc = (ratio_rows(x, y, 0) for x, y in ((a, c), (a, b), (b, c)))
    rows = without_common_power(_less(_both(ac, ac), _both(ab, bc)))
    found: list[float] = []
    for place in zeros_between(RealFunction(rows), 0.0, highest):
        roots = np.roots([complex(part(1j * place)) for part in (c, b, a)])
        # One of them is real, but for rounding.
        found += [float(p.real) for p in roots if p.real > 0.0 and abs(p.imag) <= _REAL * abs(p)]
    low = max((p for p in found if p < value), default=0.0)
    return low, min((p for p in found if p > value), default=math.inf)


def _parts(
    family: ParametricQuasiPolynomial, name: str
) -> tuple[QuasiPolynomial, QuasiPolynomial, QuasiPolynomial]:
    """The terms without the parameter, with it, and with its square."""
    parts = [0.0 * s, 0.0 * s, 0.0 * s]
    for (powers, power, (late, _)), number in family._terms.items():
        exponent = dict(powers).get(name, 0)
        parts[exponent] = parts[exponent] + number * s**power * delay(late)
    return parts[0], parts[1], parts[2]


def _both(x: _Rows, y: _Rows) -> _Rows:
    """Rows whose imaginary part is Im X Im Y = Im(j (X conj(Y) - X Y)/2)."""
    total: _Rows = {}
    for late, row in x.items():
        for later, other in y.items():
            for sign, place, factor in (
                (1.0, late - later, np.conj(other)),
                (-1.0, late + later, other),
            ):
                part = 0.5j * sign * np.convolve(row, factor)
                total[place] = np.asarray(
                    polynomial.polyadd(total.get(place, np.zeros(1)), part), np.complex128
                )
    return total


def _less(x: _Rows, y: _Rows) -> _Rows:
    total = dict(x)
    for late, row in y.items():
        total[late] = np.asarray(
            polynomial.polysub(total.get(late, np.zeros(1)), row), np.complex128
        )
    if 0.0 in total:
        total[0.0] = np.asarray(1j * total[0.0].imag, np.complex128)
    return total
