"""Where roots cross the imaginary axis as one number varies, and the delay margin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Protocol, SupportsFloat

import numpy as np
from numpy.typing import NDArray

import deadtime.roots._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import DeadtimeError
from deadtime._base.frozen import ReadOnlyArrays, read_only
from deadtime._base.validation import Range, interval, numbers_at
from deadtime.roots._family import HasFamily, family_of
from deadtime.roots._parametric import ParametricQuasiPolynomial
from deadtime.roots._quasipolynomial import QuasiPolynomial


class HasDelayMargin(Protocol):
    """A stable loop that bears some further delay."""

    def _delay_margin(self) -> float: ...


#: Ranges of real and imaginary parts, checked.
RIGHT_HALF_PLANE = (0.0, math.inf), (-math.inf, math.inf)


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
    unlisted : tuple of (low, high)
        Ranges of a gain in which crossings are not listed, because chains of infinitely many roots
        reach the imaginary axis there or come close: the leading coefficient of a neutral equation
        does not outweigh the later ones, or vanishes.

    Notes
    -----
    All arrays are read-only.
    """

    parameter: str
    range: tuple[float, float]
    values: Array
    omega: Array
    direction: NDArray[np.int32]
    family: ParametricQuasiPolynomial
    unlisted: tuple[tuple[float, float], ...] = ()

    @property
    def intervals(self) -> tuple[tuple[float, float], ...]:
        """Where the number of unstable roots stays the same: `range`, parted by the crossings.

        And by the ends of `unlisted`, within which that is not said.
        """
        edges = [end for gap in self.unlisted for end in gap]
        inner = sorted([*self.values.tolist(), *(e for e in edges if e not in self.range)])
        return tuple(pairwise([self.range[0], *inner, self.range[1]]))

    @cached_property
    def counts(self) -> NDArray[np.int32]:
        """Number of unstable roots in each of `intervals`: below, between and above the crossings.

        Each is a proved count in the middle of its interval; -2 where it cannot be proved, as
        between crossings that are too close to each other, and -1 for what is `unlisted`.

        Examples
        --------
        >>> import deadtime as dtm
        >>> (K,) = dtm.parameters("K")
        >>> dtm.crossings(dtm.s + K * dtm.delay(1.0), {"K": (-1, 10)}).counts
        array([1, 0, 2, 4], dtype=int32)
        """
        found = [self._count(low, high) for low, high in self.intervals]
        return np.asarray(read_only(np.array(found, dtype=np.int32)))

    @cached_property
    def stable_ranges(self) -> tuple[tuple[float, float], ...]:
        """The open intervals of the parameter, within `range`, in which no root is unstable."""
        gaps = zip(self.intervals, self.counts.tolist(), strict=True)
        return tuple(gap for gap, count in gaps if count == 0 and gap[0] < gap[1])

    def _count(self, low: float, high: float) -> int:
        middle = low + 0.5 * (high - low)
        if any(first <= middle <= last for first, last in self.unlisted):
            return -1
        if not low < middle < high:
            return -2
        try:
            member: QuasiPolynomial = self.family.at(**{self.parameter: middle})
            return member._native.count(*RIGHT_HALF_PLANE, "error")
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
        shown = shown or ["none"]
        shown += [
            f"crossings from {low:.6g} to {high:.6g} are not listed" for low, high in self.unlisted
        ]
        return f"<Crossings of {within}: {', '.join(shown)}>"


def crossings(
    family: HasFamily,
    ranges: Mapping[str, Range],
    *,
    at: Mapping[str, SupportsFloat] | None = None,
) -> Crossings:
    """Every crossing of the imaginary axis as one gain or one delay varies.

    Parameters
    ----------
    family : ParametricQuasiPolynomial, ControlLoop, TransferFunction or DelaySystem
        The equation; a continuous loop, whose limit plays no part; a loop gain, on which ``gain``
        is a factor and ``delay`` a further delay; or a system, of which ``delay`` varies: the
        least delay of its states, to which the others keep their ratio.
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
        neither as a factor of some terms alone, nor as a delay alone of which all multiples are
        whole ones of the least, up to five of it. And where chains of roots of a neutral equation
        may reach the axis in the whole range (for a gain: in a part of it, see `Crossings`), a root
        stays on the axis for all values, or double precision does not suffice.
    TypeError
        If `family` is something else, or an end is not a number.

    Notes
    -----
    The list is complete. For a gain that is proved, rounding included [1]_; for a delay every
    frequency with abs(A) = abs(B) is found by bounds on derivatives and rounding, and each gives
    its delays in closed form [2]_, [3]_. Where several multiples of a delay enter, the frequencies
    are those at which the polynomial in ``exp(-s T)`` shares a root with its reciprocal, found by
    the same bounds, and each is refined by Newton's iteration.

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
    name, ends = _one_range(ranges)
    equation = family_of(family, (name,), at)
    equation.at(**{name: ends[0]}), equation.at(**{name: ends[1]})
    found = native.crossings(equation._family, ends)
    return Crossings(
        parameter=name,
        range=ends,
        values=found.values,
        omega=found.omega,
        direction=found.direction,
        family=equation,
        unlisted=tuple(found.unlisted),
    )


def delay_margin(
    loop: HasDelayMargin | ParametricQuasiPolynomial,
    *,
    at: Mapping[str, SupportsFloat] | None = None,
) -> float:
    """How much further delay a stable loop bears before it becomes unstable.

    Parameters
    ----------
    loop : ControlLoop, TransferFunction, QuasiPolynomial, ParametricQuasiPolynomial or DelaySystem
        A loop; a loop gain, around which unit feedback is closed; a characteristic function, whose
        part with delays is delayed further; an equation in which one parameter is a delay; or a
        system, of whose states the delays grow in proportion.
    at : mapping of str to float, optional
        For an equation: the values of all its parameters, the present delay among them.

    Returns
    -------
    float
        In s: in an equation, the growth of the parameter; in a system, that of the least delay.
        ``inf`` where no delay makes it unstable, 0 where any does, as in a neutral loop whose
        leading coefficients outweigh the first.

    Raises
    ------
    ValueError
        If the loop is not stable as it is, or as in `crossings`.
    TypeError
        If `loop` is something else.

    Notes
    -----
    Continuous: the first of all crossings, none of which is missed. Sampled: the end of
    ``ControlLoop.stable_range("delay")``, whatever the number of samples.

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
        return margin_of_family(loop, numbers_at(at))
    if at is not None:
        raise TypeError(
            "at= gives values to the parameters of an equation, but the parameters of a loop "
            "have values already: leave at out"
        )
    found = getattr(loop, "_delay_margin", None)
    if found is None:
        raise TypeError(
            f"loop is of type {type(loop).__name__}: give a ControlLoop, a TransferFunction, or an "
            "expression with parameters from dtm.parameters('...')"
        )
    margin: float = found()
    return margin


def margin_of_family(family: ParametricQuasiPolynomial, at: Mapping[str, float]) -> float:
    """Growth of the one delay of an equation until its members lose stability, s."""
    family._family_of(at)
    family.at(**at)
    delays = {name for _, _, (_, slopes) in family._terms for name, _ in slopes}
    if len(delays) != 1:
        raise ValueError(
            f"crossings need exactly one delay as a parameter, but there are {len(delays)} "
            f"({', '.join(sorted(delays)) or 'none'}): keep one, and replace the others by "
            "numbers in the equation"
        )
    (name,) = delays
    start = at[name]
    others = {other: value for other, value in at.items() if other != name}
    return native.delay_margin(family_of(family, (name,), others)._family, start)


def _one_range(ranges: Any) -> tuple[str, Range]:
    if not isinstance(ranges, Mapping):
        raise TypeError(f"ranges={ranges!r}: give a dict such as {{'Kp': (0, 6)}}")
    if len(ranges) != 1:
        raise ValueError(
            f"crossings need a range of exactly one parameter, but ranges of {len(ranges)} "
            f"parameters ({', '.join(map(str, ranges))}) are given. For two parameters, use "
            "stability_map and the boundaries of the map"
        )
    ((name, given),) = ranges.items()
    return name, interval(name, given)
