"""Where roots cross the imaginary axis as one number of an equation varies, and the delay margin.

A gain k: h = A + k B on the axis only where Im(A conj B) = 0, and then k = -Re(A/B) (Neimark 1949);
the native core finds all zeros of that function up to a radius that no unstable root exceeds.

A delay T: h = A + B e^{-smT}, A and B free of T, has a root j omega for some T only where

    |A(j omega)|^2 = |B(j omega)|^2,  and then for m T omega = arg(-B/A) + 2 pi n;

as T grows the pair goes to the right where d/d omega (|A|^2 - |B|^2) > 0, to the left where it is
negative, whatever T is (Cooke and van den Driessche 1986; Walton and Marshall 1987).
`zeros_between` misses none of these frequencies. The values themselves carry rounding only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, SupportsFloat, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._errors import DeadtimeError
from deadtime._families import family_of
from deadtime._frequency import DifferenceOfSquares, OnAxis
from deadtime._frozen import ReadOnlyArrays, read_only
from deadtime._loop import ControlLoop
from deadtime._margins import Margins, gain_crossovers
from deadtime._parametric import Parameter, ParametricQuasiPolynomial
from deadtime._quasipolynomial import QuasiPolynomial, delay, s
from deadtime._transfer import TransferFunction
from deadtime._validation import finite

__all__ = ["Crossings", "crossings", "delay_margin"]

_Floats: TypeAlias = NDArray[np.float64]

#: Coefficients by power of s, by constant part and slope of their delay.
_Rows: TypeAlias = dict[tuple[float, float], dict[int, float]]

#: More crossings than anyone can look at.
_MOST = 1_000_000

#: A zero that both parts share is a multiple one of the difference of their squares, and so met to
#: the square or the third root of the rounding only; their quotient means nothing there.
_COMMON = 1e-4

#: Room for the rounding of sums of leading coefficients.
_ROOM = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class Crossings(ReadOnlyArrays):
    """Crossings of the imaginary axis as one number varies; made by `crossings`.

    Attributes
    ----------
    parameter : str
        What varies.
    range : tuple of float
        Between which ends.
    values : ndarray of float64, shape (n,)
        Where roots lie on the imaginary axis, increasing.
    omega : ndarray of float64, shape (n,)
        Their imaginary parts, rad/s, zero or positive.
    direction : ndarray of int32, shape (n,)
        Roots that become unstable as the parameter grows, less those that become stable: 2 or -2
        for a pair, 1 or -1 at ``omega = 0``; 0 where roots only touch the axis, or double precision
        does not tell.
    family : ParametricQuasiPolynomial
        The equation, in which `parameter` alone has no value.

    Notes
    -----
    All arrays are read-only.
    """

    parameter: str
    range: tuple[float, float]
    values: _Floats
    omega: _Floats
    direction: NDArray[np.int32]
    family: ParametricQuasiPolynomial

    @cached_property
    def counts(self) -> NDArray[np.int32]:
        """Number of unstable roots below, between and above the crossings, shape (n + 1,).

        Each is a proved count in the middle of its interval; -2 where it cannot be proved, as
        between crossings that are too close to each other.

        Examples
        --------
        >>> import deadtime as dtm
        >>> (K,) = dtm.parameters("K")
        >>> dtm.crossings(dtm.s + K * dtm.delay(1.0), {"K": (-1, 10)}).counts
        array([1, 0, 2, 4], dtype=int32)
        """
        found = [self._count(low, high) for low, high in self._gaps()]
        return np.asarray(read_only(np.array(found, dtype=np.int32)))

    @cached_property
    def stable_ranges(self) -> tuple[tuple[float, float], ...]:
        """The open intervals of the parameter, within `range`, in which no root is unstable."""
        gaps = zip(self._gaps(), self.counts.tolist(), strict=True)
        return tuple(gap for gap, count in gaps if count == 0 and gap[0] < gap[1])

    def _gaps(self) -> list[tuple[float, float]]:
        return list(pairwise([self.range[0], *self.values.tolist(), self.range[1]]))

    def _count(self, low: float, high: float) -> int:
        middle = low + 0.5 * (high - low)
        if not low < middle < high:
            return -2
        try:
            return self.family.at(**{self.parameter: middle}).count(re=(0.0, None))
        except DeadtimeError:
            return -2

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        low, high = self.range
        within = f"{self.parameter} {low:.6g} to {high:.6g}"
        shown = [
            f"{value:.6g} ({sign:+d} at {omega:.4g} rad/s)"
            for value, sign, omega in zip(
                self.values[:4].tolist(), self.direction.tolist(), self.omega.tolist(), strict=False
            )
        ]
        if len(self) > len(shown):
            shown.append(f"and {len(self) - len(shown)} more")
        return f"<Crossings of {within}: {', '.join(shown) or 'none'}>"


def crossings(
    family: ParametricQuasiPolynomial | ControlLoop,
    ranges: Mapping[str, tuple[float, float]],
    *,
    at: Mapping[str, SupportsFloat] | None = None,
) -> Crossings:
    """Every crossing of the imaginary axis as one gain or one delay varies.

    Parameters
    ----------
    family : ParametricQuasiPolynomial or ControlLoop
        The equation, or a continuous loop, whose limit plays no part.
    ranges : mapping of str to (low, high)
        The one number that varies, and between which ends.
    at : mapping of str to float, optional
        Values of the other parameters; those of a loop have values, which these replace.

    Returns
    -------
    Crossings

    Raises
    ------
    ValueError
        If a name is unknown or another parameter has no value, the range is empty or leads to
        negative delays, the loop is sampled, or the parameter enters in a way that is not covered:
        neither as a factor of some terms alone, nor as one multiple of a delay alone. And where the
        leading term vanishes within the range, chains of roots of a neutral equation may reach the
        axis, a root stays on the axis for all values, or double precision does not suffice.
    TypeError
        If `family` is something else, or an end is not a number.

    Notes
    -----
    The list is complete. For a gain that is proved, rounding included [1]_; for a delay every
    frequency with abs(A) = abs(B) is found by bounds on derivatives and rounding, and each gives
    its delays in closed form [2]_, [3]_.

    References
    ----------
    .. [1] Yu. I. Neimark, "Stability of linearized systems", Leningrad (1949): D-decomposition.
    .. [2] K. L. Cooke and P. van den Driessche, "On zeroes of some transcendental equations",
       Funkcialaj Ekvacioj 29 (1986).
    .. [3] K. Walton and J. E. Marshall, "Direct method for TDS stability analysis", IEE Proceedings
       D 134 (1987).

    Examples
    --------
    Delayed feedback of an oscillator: delays that destabilise, and some that stabilise again.

    >>> import deadtime as dtm
    >>> (T,) = dtm.parameters("T")
    >>> found = dtm.crossings(dtm.s**2 + 4.0 - 1.0 * dtm.delay(T), {"T": (0.1, 7)})
    >>> found.values.round(4), found.direction
    (array([1.405 , 3.6276, 4.2149]), array([ 2, -2,  2], dtype=int32))
    """
    (name, ends), fixed = _one_range(ranges), dict(at or {})
    alone = _alone(family, name, fixed)
    alone.at(**{name: ends[0]}), alone.at(**{name: ends[1]})
    if _is_factor(alone, name):
        values, omega, direction = alone._family.crossings([0.0], 0, ends)
    else:
        values, omega, direction = _of_delay(alone, name, ends)
    order = np.lexsort((omega, values))
    arrays = (values[order] + 0.0, omega[order], direction[order].astype(np.int32))
    for array in arrays:
        read_only(array)
    return Crossings(name, ends, *arrays, alone)


def delay_margin(
    loop: ControlLoop | TransferFunction | ParametricQuasiPolynomial,
    *,
    at: Mapping[str, SupportsFloat] | None = None,
) -> float:
    """How much further delay a stable loop bears before it becomes unstable.

    Parameters
    ----------
    loop : ControlLoop, TransferFunction or ParametricQuasiPolynomial
        A loop; a loop gain, around which unit feedback is closed; or an equation in which one
        parameter is a delay.
    at : mapping of str to float, optional
        For an equation: the values of all its parameters, the present delay among them.

    Returns
    -------
    float
        In s: in an equation, the growth of the parameter. ``inf`` where no delay makes it
        unstable, 0 where any does, as in a neutral loop whose leading coefficients outweigh the
        first.

    Raises
    ------
    ValueError
        If the loop is not stable as it is, or as in `crossings`.
    TypeError
        If `loop` is something else.

    Notes
    -----
    Continuous: the first of all crossings, none of which is missed. Sampled: the end of
    ``ControlLoop.stable_range("delay")``, a search in growing steps, which can pass over a loss of
    stability that is regained within a step.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36)
    >>> round(dtm.delay_margin(loop), 4)  # pi/4 - 0.36
    0.4254
    >>> round(dtm.delay_margin(loop.replace(sample_time=0.065)), 4)
    0.3939
    >>> (T,) = dtm.parameters("T")
    >>> round(dtm.delay_margin(dtm.s + 2.0 * dtm.delay(T), at={"T": 0.36}), 4)
    0.4254
    """
    if isinstance(loop, ParametricQuasiPolynomial):
        return _margin_of_family(loop, dict(at or {}))
    if at is not None:
        raise TypeError("at= gives the parameters of an equation; a loop has its numbers already")
    if isinstance(loop, ControlLoop):
        if loop.is_sampled:
            return loop.stable_range("delay")[1] - loop._known_delay()
        return _told(loop.margin())
    if isinstance(loop, TransferFunction):
        return _told(loop.margin())
    raise TypeError(
        f"loop of type {type(loop).__name__}: give a ControlLoop, a TransferFunction, or an "
        "expression with the parameters of dtm.parameters('...')"
    )


def _told(margins: Margins) -> float:
    if not margins.stable:
        raise ValueError("the loop is not stable as it is: it has no delay margin")
    return margins.delay_margin


def _margin_of_family(family: ParametricQuasiPolynomial, at: dict[str, SupportsFloat]) -> float:
    member = family.at(**at)
    delays = {name for _, _, (_, slopes) in family._terms for name, _ in slopes}
    if len(delays) != 1:
        raise ValueError(
            f"{len(delays)} parameters are delays ({', '.join(sorted(delays)) or 'none'}): leave "
            "one of them, and put numbers in place of the others where the equation is written"
        )
    (name,) = delays
    start = finite(name, at.pop(name))
    alone = _alone(family, name, at)
    rows = _rows(alone, name)
    if any(slope < 0.0 for _, slope in rows):
        raise ValueError(f"a delay of {family!r} falls as {name} grows: it has no delay margin")
    if not member.is_stable():
        raise ValueError(f"not stable at {name}={start}: it has no delay margin")
    far = 2.0 * start + 2.0 * max(constant for constant, _ in rows) + 1.0
    lead, rest = _leading(rows, name, start, far)
    if lead <= rest:
        return 0.0
    omega, first, period, _ = _delays_of(rows, name)
    if not omega.size:
        return math.inf
    later = first + period * np.ceil((start - first) / period)
    later = np.where(later <= start, later + period, later)
    return float(later.min()) - start


def _one_range(ranges: Any) -> tuple[str, tuple[float, float]]:
    if not isinstance(ranges, Mapping):
        raise TypeError(f"ranges={ranges!r}: give a dict such as {{'Kp': (0, 6)}}")
    if len(ranges) != 1:
        raise ValueError(
            f"ranges for {len(ranges)} parameters ({', '.join(map(str, ranges))}): crossings are "
            "those of one; for two there is stability_map and its boundaries"
        )
    ((name, given),) = ranges.items()
    try:
        low, high = given
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}={given!r}: give its range as (low, high)") from error
    low, high = finite(name, low), finite(name, high)
    if low >= high:
        raise ValueError(f"{name}={given!r}: the low end of a range is below its high end")
    return name, (low, high)


def _alone(
    family: ParametricQuasiPolynomial | ControlLoop, name: str, at: Mapping[str, SupportsFloat]
) -> ParametricQuasiPolynomial:
    """The equation in which `name` alone has no value."""
    values = {other: finite(other, value) for other, value in at.items()}
    if name in values:
        raise ValueError(f"{name}={values[name]}: what varies has no value of its own")
    own = Parameter(name)
    total: Any = 0.0 * own
    for (powers, power, (constant, slopes)), number in family_of(
        family, (name, *values)
    )._terms.items():
        exponents, rates = dict(powers), dict(slopes)
        coefficient = math.prod((values[q] ** exponents.get(q, 0) for q in values), start=number)
        time = constant + sum(values[q] * rates.get(q, 0.0) for q in values)
        late = delay(own * rates[name] + time) if name in rates else delay(time)
        total = total + coefficient * own ** exponents.get(name, 0) * s**power * late
    found: ParametricQuasiPolynomial = total
    return found


def _is_factor(family: ParametricQuasiPolynomial, name: str) -> bool:
    """Tell whether `name` is a factor, if anything, and in no delay."""
    factor = any(dict(powers).get(name, 0) for powers, _, _ in family._terms)
    late = any(dict(slopes).get(name, 0.0) for _, _, (_, slopes) in family._terms)
    if factor and late:
        raise ValueError(
            f"{name} is both a factor and a delay in {family!r}: crossings are those of a gain, or "
            "of a delay; a map over it and a second parameter shows its counts"
        )
    return not late


def _rows(family: ParametricQuasiPolynomial, name: str) -> _Rows:
    """Coefficients by delay; `name` is no factor."""
    _is_factor(family, name)
    rows: _Rows = {}
    for (_, power, (constant, slopes)), coefficient in family._terms.items():
        place = (constant, dict(slopes).get(name, 0.0))
        rows.setdefault(place, {})[power] = coefficient
    return rows


def _of_delay(
    family: ParametricQuasiPolynomial, name: str, ends: tuple[float, float]
) -> tuple[_Floats, _Floats, NDArray[np.int32]]:
    """Values, frequencies and directions for a delay."""
    rows = _rows(family, name)
    lead, rest = _leading(rows, name, *ends)
    if lead <= rest:
        raise ValueError(
            "the equation is neutral and its leading coefficient does not outweigh the later ones: "
            f"chains of infinitely many roots may reach the imaginary axis for some {name}"
        )
    omega, first, period, direction = _delays_of(rows, name)
    from_, to = np.ceil((ends[0] - first) / period), np.floor((ends[1] - first) / period)
    many = np.maximum(to - from_ + 1.0, 0.0)
    if many.sum() > _MOST:
        raise ValueError(f"more than {_MOST} crossings: choose a smaller range of {name}")
    which = np.repeat(np.arange(len(omega)), many.astype(np.int64))
    place = np.arange(len(which)) - np.repeat(np.cumsum(many) - many, many.astype(np.int64))
    values = np.clip(first[which] + period[which] * (from_[which] + place), *ends)
    return values, omega[which], direction[which]


def _leading(rows: _Rows, name: str, low: float, high: float) -> tuple[float, float]:
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


def _delays_of(rows: _Rows, name: str) -> tuple[_Floats, _Floats, _Floats, NDArray[np.int32]]:
    """Frequencies at which roots cross, a delay for each, the period of its delays, direction."""
    empty = np.zeros(0)
    slopes = sorted({slope for _, slope in rows})
    if len(slopes) > 2:
        gaps = ", ".join(f"{slope - slopes[0]:g} {name}" for slope in slopes[1:])
        raise ValueError(
            f"{name} enters as several delays ({gaps}): the crossings of a delay are known where "
            "it enters as one multiple of itself; a map over it and a second parameter shows its "
            "counts"
        )
    if len(slopes) < 2:
        return empty, empty, empty, empty.astype(np.int32)
    shift = min(constant for constant, _ in rows)
    a, b = (_part(rows, slope, shift) for slope in slopes)
    multiple = slopes[1] - slopes[0]
    if a(0.0) + b(0.0) == 0.0:
        raise ValueError(f"a root stays at s = 0 whatever {name} is: divide the equation by s")
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


def _part(rows: _Rows, slope: float, shift: float) -> QuasiPolynomial:
    """The terms with one slope, without e^(-s slope T)."""
    total = 0.0 * s
    for (constant, own), row in rows.items():
        if own == slope:
            for power, coefficient in row.items():
                total = total + coefficient * s**power * delay(constant - shift)
    return total
