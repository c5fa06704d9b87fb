"""Values of one number of an equation at which roots lie on the imaginary axis.

A gain k: h = A + k B on the axis only where Im(A conj B) = 0, and then k = -Re(A/B) (Neimark 1949);
the native core finds all zeros of that function up to a radius that no unstable root exceeds. There
is such a radius where the leading coefficient outweighs the later ones of that power; elsewhere
chains of infinitely many roots may reach the axis.

A delay T: h = A + B e^{-s m T}, A and B free of T, has a root j omega for some T only where

    |A(j omega)|^2 = |B(j omega)|^2,  and then for m T omega = arg(-B/A) + 2 pi n;

as T grows the pair goes to the right where d/d omega (|A|^2 - |B|^2) > 0, to the left where it is
negative, whatever T is (Cooke and van den Driessche 1986; Walton and Marshall 1987). Where T enters
as several multiples of one, see `_multiples`. `zeros_between` misses none of these frequencies. The
values themselves carry rounding only.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime.roots._crossovers import gain_crossovers
from deadtime.roots._frequency import DifferenceOfSquares, OnAxis
from deadtime.roots._multiples import crossings_of_multiples
from deadtime.roots._parametric import ParametricQuasiPolynomial
from deadtime.roots._quasipolynomial import QuasiPolynomial, delay, s

__all__ = [
    "Places",
    "chain_free",
    "is_factor",
    "leading",
    "of_delay",
    "of_gain",
    "periods",
    "rows_of",
]

_Floats: TypeAlias = NDArray[np.float64]
_Range: TypeAlias = tuple[float, float]

#: Values, frequencies and directions of crossings.
Places: TypeAlias = tuple[_Floats, _Floats, NDArray[np.int32]]

#: Coefficients by power of s, by constant part and slope of their delay.
Rows: TypeAlias = dict[tuple[float, float], dict[int, float]]

#: More crossings than anyone can look at.
_MOST = 1_000_000

#: A zero that both parts share is a multiple one of the difference of their squares, and so met to
#: the square or the third root of the rounding only; their quotient means nothing there.
_COMMON = 1e-4

#: Room for the rounding of sums of leading coefficients.
_ROOM = 1e-12

#: Crossings are not listed within this part of the range of where chains reach the axis: the
#: frequencies at which they may lie grow without bound there.
_NEAR_CHAINS = 1e-3


def of_gain(
    family: ParametricQuasiPolynomial, name: str, ends: _Range
) -> tuple[Places, tuple[_Range, ...]]:
    """Crossings as the gain `name` varies, and the ranges in which they are not listed."""
    unlisted = _near_chains(family, name, ends)
    bounds = [ends[0], *(end for gap in unlisted for end in gap), ends[1]]
    parts = [(low, high) for low, high in zip(bounds[::2], bounds[1::2], strict=True) if low < high]
    if not parts:
        raise ValueError(
            f"for every {name} from {ends[0]:.6g} to {ends[1]:.6g} the leading coefficient does "
            "not outweigh the later ones of the highest power of s: chains of infinitely many "
            "roots may reach the imaginary axis"
        )
    found = [family._family.crossings([0.0], 0, part) for part in parts]
    values, omega, direction = (np.concatenate(part) for part in zip(*found, strict=True))
    return (values, omega, direction), unlisted


def chain_free(family: ParametricQuasiPolynomial, name: str, start: float, end: float) -> float:
    """How far from `start` towards `end` the leading coefficient outweighs the others."""
    low, high = sorted((start, end))
    reached = _chains(family, name, (low, high))
    if not reached:
        return end
    return min(gap[0] for gap in reached) if end > start else max(gap[1] for gap in reached)


def _near_chains(family: ParametricQuasiPolynomial, name: str, ends: _Range) -> tuple[_Range, ...]:
    """Where the leading coefficient does not outweigh the others of that power, and next to it."""
    low, high = ends
    room = _NEAR_CHAINS * (high - low)
    found: list[_Range] = []
    for start, end in _chains(family, name, ends):
        gap = (max(start - room, low), min(end + room, high))
        if found and gap[0] <= found[-1][1]:
            gap = (found.pop()[0], gap[1])
        found.append(gap)
    return tuple(found)


def _chains(family: ParametricQuasiPolynomial, name: str, ends: _Range) -> list[_Range]:
    """Where the leading coefficient does not outweigh the others of that power.

    |a_0 + k b_0| - sum |a_i + k b_i| is linear in k between the zeros of its terms.
    """
    degree = max((power for _, power, _ in family._terms), default=0)
    first = min((late for _, _, (late, _) in family._terms), default=0.0)
    pairs: dict[float, list[float]] = {first: [0.0, 0.0]}
    for (powers, power, (late, _)), number in family._terms.items():
        exponent = dict(powers).get(name, 0)
        if power == degree and exponent <= 1:
            pairs.setdefault(late, [0.0, 0.0])[exponent] += number
    terms = [pair for _, pair in sorted(pairs.items())]

    def excess(k: float) -> float:
        sizes = [abs(a + k * b) for a, b in terms]
        return sizes[0] * (1.0 - _ROOM) - sum(sizes[1:])

    low, high = ends
    bends = sorted(-a / b for a, b in terms if b != 0.0 and low < -a / b < high)
    found: list[_Range] = []
    for start, end in pairwise([low, *bends, high]):
        at_start, at_end = excess(start), excess(end)
        if at_start > 0.0 and at_end > 0.0:
            continue
        if at_start > 0.0:
            start += (end - start) * at_start / (at_start - at_end)
        elif at_end > 0.0:
            end = start + (end - start) * -at_start / (at_end - at_start)
        found.append((start, end))
    return found


def is_factor(family: ParametricQuasiPolynomial, name: str) -> bool:
    """Tell whether `name` is a factor, if anything, and in no delay."""
    factor = any(dict(powers).get(name, 0) for powers, _, _ in family._terms)
    late = any(dict(slopes).get(name, 0.0) for _, _, (_, slopes) in family._terms)
    if factor and late:
        raise ValueError(
            f"{name} is both a factor and a delay in {family!r}: crossings are those of a gain, or "
            "of a delay; a map over it and a second parameter shows its counts"
        )
    return not late


def rows_of(family: ParametricQuasiPolynomial, name: str) -> Rows:
    """Coefficients by delay; `name` is no factor."""
    is_factor(family, name)
    rows: Rows = {}
    for (_, power, (constant, slopes)), coefficient in family._terms.items():
        place = (constant, dict(slopes).get(name, 0.0))
        rows.setdefault(place, {})[power] = coefficient
    return rows


def of_delay(family: ParametricQuasiPolynomial, name: str, ends: _Range) -> Places:
    """Values, frequencies and directions for a delay."""
    rows = rows_of(family, name)
    lead, rest = leading(rows, name, *ends)
    if lead <= rest:
        raise ValueError(
            "the equation is neutral and its leading coefficient does not outweigh the later ones: "
            f"chains of infinitely many roots may reach the imaginary axis for some {name}"
        )
    omega, first, period, direction = periods(rows, name)
    from_, to = np.ceil((ends[0] - first) / period), np.floor((ends[1] - first) / period)
    many = np.maximum(to - from_ + 1.0, 0.0)
    if many.sum() > _MOST:
        raise ValueError(f"more than {_MOST} crossings: choose a smaller range of {name}")
    which = np.repeat(np.arange(len(omega)), many.astype(np.int64))
    place = np.arange(len(which)) - np.repeat(np.cumsum(many) - many, many.astype(np.int64))
    values = np.clip(first[which] + period[which] * (from_[which] + place), *ends)
    return values, omega[which], direction[which]


def leading(rows: Rows, name: str, low: float, high: float) -> tuple[float, float]:
    """Moduli of the leading coefficient of the smallest delay, and of all others of that power."""
    degree = max(power for row in rows.values() for power in row)
    # What is first just above the low end and just below the high end is first between them.
    first = min(rows, key=lambda row: (row[0] + row[1] * low, row[1]))
    last = min(rows, key=lambda row: (row[0] + row[1] * high, -row[1]))
    lead = abs(rows[first].get(degree, 0.0))
    if first != last or lead == 0.0:
        raise ValueError(
            f"for some {name} from {low:.6g} on the highest power of s is not without further "
            "delay: such an equation is not causal and has infinitely many unstable roots"
        )
    rest = sum(abs(row.get(degree, 0.0)) for row in rows.values()) - lead
    return lead * (1.0 - _ROOM), rest


def periods(rows: Rows, name: str) -> tuple[_Floats, _Floats, _Floats, NDArray[np.int32]]:
    """Frequencies at which roots cross, a delay for each, the period of its delays, direction."""
    empty = np.zeros(0)
    slopes = sorted({slope for _, slope in rows})
    if len(slopes) < 2:
        return empty, empty, empty, empty.astype(np.int32)
    shift = min(constant for constant, _ in rows)
    parts = [_part(rows, slope, shift) for slope in slopes]
    if sum(part(0.0) for part in parts) == 0.0:
        raise ValueError(f"a root stays at s = 0 whatever {name} is: divide the equation by s")
    if len(slopes) > 2:
        return crossings_of_multiples(parts, [slope - slopes[0] for slope in slopes], name)
    (a, b), multiple = parts, slopes[1] - slopes[0]
    omega, searched = gain_crossovers(b, a)
    if searched < math.inf:
        raise ValueError(
            f"neither the terms with {name} nor those without outweigh the others at high "
            "frequencies: there is no end to the frequencies at which roots may cross"
        )
    direction = _directions(DifferenceOfSquares(a, b), omega)
    size = OnAxis(a, 0.0).bounds(omega)[0]
    stays = (direction == 0) & (np.abs(a(1j * omega)) <= _COMMON * size)
    if stays.any():
        raise ValueError(
            f"a root stays at omega = {omega[stays][0]:.6g} rad/s whatever {name} is: divide the "
            "equation by what all its terms share"
        )
    turn = np.mod(np.angle(-b(1j * omega) / a(1j * omega)), 2.0 * np.pi)
    return omega, turn / (multiple * omega), 2.0 * np.pi / (multiple * omega), direction


def _directions(difference: DifferenceOfSquares, omega: _Floats) -> NDArray[np.int32]:
    """2 or -2 where the slope keeps its sign as far as rounding may hide the zero, else 0."""
    value, slope = np.abs(difference.value(omega)), difference.slope(omega)
    noise, slope_noise = difference.noise(omega)
    size = np.maximum(np.abs(slope), np.finfo(np.float64).tiny)
    hidden = np.minimum(2.0 * (value + noise) / size, omega)
    change = difference.change(omega, hidden, size + slope_noise)[1]
    found = np.where(size > change + slope_noise, 2.0 * np.sign(slope), 0.0)
    return found.astype(np.int32)


def _part(rows: Rows, slope: float, shift: float) -> QuasiPolynomial:
    """The terms with one slope, without e^(-s slope T)."""
    total = 0.0 * s
    for (constant, own), row in rows.items():
        if own == slope:
            for power, coefficient in row.items():
                total = total + coefficient * s**power * delay(constant - shift)
    return total
