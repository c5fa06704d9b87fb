"""Boxes of gains and delays that are proved stable.

Not sampled: every member of such a box has the stated number of unstable roots. The number of
roots right of the imaginary axis changes only where a root lies on the axis or comes from
infinity; both are excluded for all members of a box at once, and the roots of one are counted.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime import _deadtime
from deadtime._families import family_of
from deadtime._frozen import ReadOnlyArrays, read_only
from deadtime._loop import ControlLoop
from deadtime._parametric import ParametricQuasiPolynomial
from deadtime._stability import _axes
from deadtime._validation import finite, non_negative, positive, real_array, thread_number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "ProvedBoxes",
    "RobustMap",
    "StabilityRadius",
    "largest_stable_box",
    "proved_boxes",
    "robust_map",
    "stability_radius",
]

_Floats: TypeAlias = NDArray[np.float64]
_Progress: TypeAlias = Callable[[int], object]
_Range: TypeAlias = tuple[float, float]
_System: TypeAlias = ParametricQuasiPolynomial | ControlLoop
_Given: TypeAlias = Mapping[str, tuple[SupportsFloat, SupportsFloat] | SupportsFloat]

#: Boxes are made of up to this many parameters.
_MOST = 3

#: Boxes that the search for a radius looks at before it gives what it has.
_RADIUS_BOXES = 200_000

#: Boxes that one cell of a robust map is divided into before it is undecided.
_CELL_BOXES = 1000


@dataclass(frozen=True, eq=False, repr=False)
class ProvedBoxes(ReadOnlyArrays):
    """Ranges of parameters divided into boxes with a proved count; made by `proved_boxes`.

    Attributes
    ----------
    names : tuple of str
        The parameters, d of them.
    ranges : dict of str to (low, high)
        What was divided.
    low, high : ndarray of float64, shape (n, d)
        The corners of the boxes. They meet at their faces and fill the ranges.
    unstable : ndarray of int32, shape (n,)
        Number of roots with a positive real part of every member of the box, none of which has a
        root on the axis: 0 is stable; -1 for infinitely many, -2 where it is undecided.
    undecided : float
        Share of the ranges that is undecided, from 0 to 1.

    Notes
    -----
    All arrays are read-only.
    """

    names: tuple[str, ...]
    ranges: dict[str, _Range]
    low: _Floats
    high: _Floats
    unstable: NDArray[np.int32]
    undecided: float
    _tree: dict[str, NDArray[Any]]

    @cached_property
    def stable_share(self) -> float:
        """Share of the ranges that is proved stable, from 0 to 1."""
        ends = np.array([self.ranges[name] for name in self.names])
        widths = ends[:, 1] - ends[:, 0]
        moving = widths > 0.0
        stable = self.unstable == 0
        sides = (self.high - self.low)[stable][:, moving] / widths[moving]
        return float(np.prod(sides, axis=1).sum())

    def count_at(
        self, points: ArrayLike | None = None, /, **values: ArrayLike
    ) -> NDArray[np.int32] | int:
        """Look the number of unstable roots up.

        Parameters
        ----------
        points : array_like, shape (..., d), optional
            Values of the parameters in the order of `names`.
        **values : array_like
            Or by name, one for each, broadcast against each other.

        Returns
        -------
        int or ndarray of int32, shape (...)
            As in `unstable`; -2 also outside the ranges.

        Raises
        ------
        TypeError, ValueError
            If a name is missing or unknown, or the points are not d numbers each.

        Examples
        --------
        >>> import deadtime as dtm
        >>> Kp, = dtm.parameters("Kp")
        >>> boxes = dtm.proved_boxes(dtm.s + Kp * dtm.delay(0.36), {"Kp": (0, 6)})
        >>> boxes.count_at(Kp=2.0)
        0
        >>> boxes.count_at(Kp=[1.0, 5.0, 7.0])
        array([ 0,  2, -2], dtype=int32)
        """
        if (points is None) == (not values):
            raise TypeError("give points as one array, or the values of all parameters by name")
        if points is not None:
            array = real_array("points", points)
            if array.ndim == 0 or array.shape[-1] != len(self.names):
                raise ValueError(
                    f"points of shape {array.shape}: the last axis holds {', '.join(self.names)}"
                )
        else:
            wrong = [name for name in values if name not in self.names]
            wrong += [name for name in self.names if name not in values]
            if wrong:
                raise ValueError(f"{wrong[0]}: give exactly {', '.join(self.names)}")
            columns = [real_array(name, values[name]) for name in self.names]
            array = np.stack(np.broadcast_arrays(*columns), axis=-1)
        flat = array.reshape(-1, len(self.names))
        ends = np.array([self.ranges[name] for name in self.names])
        inside = ((ends[:, 0] <= flat) & (flat <= ends[:, 1])).all(axis=1)
        node = np.zeros(len(flat), dtype=np.int64)
        parameter, at, link = (self._tree[name] for name in ("parameter", "at", "link"))
        going = np.flatnonzero(inside)
        while going.size:
            here = node[going]
            going, here = going[parameter[here] >= 0], here[parameter[here] >= 0]
            node[going] = link[here] + (flat[going, parameter[here]] > at[here])
        counts = np.where(inside, self.unstable[link[node]], np.int32(-2)) if flat.size else node
        result = counts.astype(np.int32).reshape(array.shape[:-1])
        return result if result.ndim else int(result)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the boxes of two parameters: stable, unstable, undecided.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If not exactly two parameters have a range.
        """
        from deadtime._box_plots import plot_boxes, shown_axes

        return plot_boxes(shown_axes(ax), self)

    def __repr__(self) -> str:
        sides = ", ".join(_side(name, *self.ranges[name]) for name in self.names)
        return (
            f"<ProvedBoxes {sides}: {len(self.unstable)} boxes, {100 * self.stable_share:.4g} % "
            f"stable, {100 * self.undecided:.3g} % undecided>"
        )


@dataclass(frozen=True, eq=False)
class StabilityRadius:
    """How far parameters may move; made by `stability_radius`.

    Attributes
    ----------
    radius : float
        Proved: every member with each parameter within ``radius * scale`` is stable.
    upper : float
        The radius cannot exceed this: a member at this distance is not stable, or parameters
        cannot go further because a delay would be negative. Infinite if neither was met.
    witness : dict of str to float, or None
        That member.
    ranges : dict of str to (low, high)
        The proved box; delays end at 0.
    """

    radius: float
    upper: float
    witness: dict[str, float] | None
    ranges: dict[str, _Range]


@dataclass(frozen=True, eq=False, repr=False)
class RobustMap(ReadOnlyArrays):
    """Stability over two parameters for all values of others; made by `robust_map`.

    Attributes
    ----------
    names : tuple of str
        The two parameters: first and second axis of the array.
    axes : dict of str to ndarray
        Their values, increasing.
    over : dict of str to (low, high)
        The intervals of the others.
    unstable : ndarray of int32, shape (n0, n1)
        0 where every value in the intervals is proved stable. Otherwise a number of unstable
        roots that some member has, the largest that was met; -1 for infinitely many, -2 where
        nothing could be proved.

    Notes
    -----
    All arrays are read-only.
    """

    names: tuple[str, str]
    axes: dict[str, _Floats]
    over: dict[str, _Range]
    unstable: NDArray[np.int32]

    @cached_property
    def stable(self) -> NDArray[np.bool_]:
        """Where all members are proved stable, shape (n0, n1)."""
        stable: NDArray[np.bool_] = self.unstable == 0
        stable.flags.writeable = False
        return stable

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw where all members are stable, some are not, and nothing is proved.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from deadtime._box_plots import plot_robust_map, shown_axes

        return plot_robust_map(shown_axes(ax), self)

    def __repr__(self) -> str:
        sides = ", ".join(
            f"{name} {axis[0]:.6g} to {axis[-1]:.6g} ({len(axis)})"
            for name, axis in self.axes.items()
        )
        held = ", ".join(_side(name, *self.over[name]) for name in self.over)
        return (
            f"<RobustMap {sides} for all {held}: {int(self.stable.sum())} of {self.stable.size} "
            "stable>"
        )


def proved_boxes(
    family: _System,
    ranges: _Given,
    tol: float = 1e-3,
    *,
    max_boxes: int = 1_000_000,
    threads: int | None = None,
    progress: _Progress | None = None,
) -> ProvedBoxes:
    """Divide ranges of gains and delays into boxes that are proved stable or unstable.

    Parameters
    ----------
    family : ParametricQuasiPolynomial or ControlLoop
        What to judge. The other named numbers of a loop keep their values.
    ranges : mapping of str to (low, high) or float
        One to three ranges; further parameters have a value.
    tol : float
        Share of the ranges that may stay undecided, from 0 to 1. The number of boxes grows like
        1/tol for two parameters and 1/tol**2 for three.
    max_boxes : int
        The division ends with this many boxes (some hundred bytes each), whatever is undecided
        then; `ProvedBoxes.undecided` says how much.
    threads : int, optional
        Number of threads; all cores by default. Results have the same bits for any number.
    progress : callable, optional
        Called now and then with the number of boxes looked at.

    Returns
    -------
    ProvedBoxes

    Raises
    ------
    ValueError
        If a name is unknown or another parameter has no value, a range is reversed or not finite,
        more than three are given, a delay would be negative, the loop is sampled, or s = 0 is a
        root whatever the parameters are.
    TypeError
        If `family` is something else, or a range is not made of numbers.

    Notes
    -----
    Let h(s; p) be the family. On a box, h(iw; p) is expanded to first order in p and in the
    frequency w; the values of the first order fill a zonotope, the second order is bounded. If a
    line separates 0 from all of it, no member has a root on that stretch of the axis [1]_. Above
    some frequency the row of the smallest delay outweighs the others for all members, and for
    neutral families so do its leading terms: then no root comes from infinity either, and the
    roots counted at the centre are those of all members. A box that fails is halved along the
    parameter that matters most there, and its halves look only at the stretches that are left.
    All bounds cover the rounding of their evaluation. Chains of neutral families are judged
    robustly, as under arbitrarily small changes of the delays.

    Boxes on the boundary of stability stay undecided, however small.

    References
    ----------
    .. [1] B. R. Barmish, "New Tools for Robustness of Linear Systems", Macmillan (1994): value sets
       and the zero exclusion principle.

    Examples
    --------
    >>> import deadtime as dtm
    >>> Kp, Kv = dtm.parameters("Kp Kv")
    >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
    >>> boxes = dtm.proved_boxes(h, {"Kp": (0, 6), "Kv": (-1, 1)}, tol=0.01)
    >>> boxes.count_at(Kp=2.0, Kv=0.3), boxes.undecided <= 0.01
    (0, True)
    """
    names, ends = _ranges(ranges)
    share = finite("tol", tol)
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"tol={share}: give a share of the ranges, from 0 to 1")
    native, places = _native(family, names)
    low, high, unstable, tree, undecided = _deadtime.proved_boxes(
        native,
        _placed(ends, places),
        share,
        _number("max_boxes", max_boxes),
        thread_number(threads),
        progress,
    )
    # The family may hold its parameters in another order.
    order = [places.index(index) for index in range(len(names))]
    low, high = low[:, places], high[:, places]
    parameter = np.array([*order, -1], dtype=np.int64)[tree[0]]
    nodes = {"parameter": parameter, "at": tree[1], "link": tree[2]}
    for array in (low, high, unstable, nodes):
        read_only(array)
    if progress is not None:
        progress(len(tree[0]))
    return ProvedBoxes(
        names, dict(zip(names, ends, strict=True)), low, high, unstable, max(undecided, 0.0), nodes
    )


def largest_stable_box(
    family: _System,
    ranges: _Given,
    *,
    around: Mapping[str, SupportsFloat] | None = None,
    tol: float = 1e-3,
    threads: int | None = None,
    progress: _Progress | None = None,
) -> dict[str, _Range]:
    """Find one large box of gains and delays all of which is proved stable.

    Parameters
    ----------
    family : ParametricQuasiPolynomial or ControlLoop
        What to judge. The other named numbers of a loop keep their values.
    ranges : mapping of str to (low, high) or float
        As in `proved_boxes`. Volumes are measured relative to them.
    around : mapping of str to float, optional
        A point that the box is to hold.
    tol : float
        The faces are pushed outwards until they move by less than this part of the ranges.
    threads, progress
        As in `proved_boxes`.

    Returns
    -------
    dict of str to (low, high)
        Every member of it is proved stable. It is the largest that a search on a grid of proved
        boxes finds, its faces pushed outwards; a somewhat larger one may exist.

    Raises
    ------
    ValueError, TypeError
        As in `proved_boxes`; ValueError also if no stable box is found, or none that holds
        `around`.

    Examples
    --------
    >>> import deadtime as dtm
    >>> Kp, Kv = dtm.parameters("Kp Kv")
    >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
    >>> box = dtm.largest_stable_box(h, {"Kp": (0, 6), "Kv": (-1, 1)})
    >>> {name: (round(low, 2), round(high, 2)) for name, (low, high) in box.items()}
    {'Kp': (0.01, 3.45), 'Kv': (-0.27, 0.88)}
    """
    names, ends = _ranges(ranges)
    step = positive("tol", tol)
    native, places = _native(family, names)
    point = None
    if around is not None:
        given = _named("around", around, names, dict(zip(names, ends, strict=True)))
        point = [given[names[place]] for place in _inverse(places)]
    found = _deadtime.largest_stable_box(
        native, _placed(ends, places), point, step, thread_number(threads), progress
    )
    if found is None:
        held = "" if around is None else f" around {dict(around)}"
        raise ValueError(
            f"no stable box{held} was found in "
            + ", ".join(_side(name, *end) for name, end in zip(names, ends, strict=True))
            + ": try other ranges"
        )
    return {name: found[place] for name, place in zip(names, places, strict=True)}


def stability_radius(
    family: _System,
    point: Mapping[str, SupportsFloat],
    scales: Mapping[str, SupportsFloat] | None = None,
    *,
    tol: float = 1e-3,
) -> StabilityRadius:
    """How far gains and delays may move away from a point, all at once, without loss of stability.

    Parameters
    ----------
    family : ParametricQuasiPolynomial or ControlLoop
        What to judge. The other named numbers of a loop keep their values.
    point : mapping of str to float
        A stable point.
    scales : mapping of str to float, optional
        The unit in which each parameter moves, |value| by default; 0 for one that does not move.
    tol : float
        Relative width of the interval from `radius` to `upper`.

    Returns
    -------
    StabilityRadius
        Every p with |p_i - point_i| <= radius * scale_i is proved stable, delays cut off at 0.

    Raises
    ------
    ValueError, TypeError
        As in `proved_boxes`; ValueError also if the point is not stable, or no parameter moves.

    Examples
    --------
    The gain and the delay of an integrator may both grow by a factor r with r**2 = pi / (2 K T):

    >>> import deadtime as dtm
    >>> K, T = dtm.parameters("K T")
    >>> found = dtm.stability_radius(dtm.s + K * dtm.delay(T), {"K": 2.0, "T": 0.36})
    >>> round(found.radius, 2), found.radius <= found.upper
    (0.48, True)
    """
    if not isinstance(point, Mapping) or not point:
        raise TypeError(f"point={point!r}: give a dict such as {{'Kp': 2.0, 'delay': 0.36}}")
    values = {name: finite(name, value) for name, value in point.items()}
    names = tuple(values)
    units = {name: abs(value) for name, value in values.items()}
    if scales is not None:
        if not isinstance(scales, Mapping):
            raise TypeError(f"scales={scales!r}: give a dict such as {{'Kp': 1.0}}")
        unknown = [name for name in scales if name not in values]
        if unknown:
            raise ValueError(f"scale of {unknown[0]}: the point has {', '.join(names)}")
        units |= {name: non_negative(f"scale of {name}", scales[name]) for name in scales}
    for name, unit in units.items():
        if unit == 0.0 and name not in (scales or ()):
            raise ValueError(f"{name}=0 has no scale of its own: give scales={{{name!r}: ...}}")
    if sum(unit > 0.0 for unit in units.values()) > _MOST:
        raise ValueError(f"more than {_MOST} parameters move: give the others a scale of 0")
    native, places = _native(family, names)
    order = [names[place] for place in _inverse(places)]
    radius, upper, witness = _deadtime.stability_radius(
        native,
        [values[name] for name in order],
        [units[name] for name in order],
        positive("tol", tol),
        _RADIUS_BOXES,
    )
    delays = _delay_names(family, names)
    ranges = {}
    for name, value in values.items():
        reach = radius * units[name]
        # Inwards: a sum may round to a place just outside.
        low = min(math.nextafter(value - reach, math.inf), value)
        high = max(math.nextafter(value + reach, -math.inf), value)
        ranges[name] = (min(max(low, 0.0), value) if name in delays else low, high)
    found = None if witness is None else dict(zip(order, witness, strict=True))
    if found is not None:
        found = {name: found[name] for name in names}
    return StabilityRadius(radius, upper, found, ranges)


def robust_map(
    family: _System,
    ranges: Mapping[str, tuple[float, float] | ArrayLike],
    over: _Given,
    shape: tuple[int, int] = (101, 101),
    *,
    threads: int | None = None,
    progress: _Progress | None = None,
) -> RobustMap:
    """Stability over two parameters, proved for every value of others in intervals.

    Parameters
    ----------
    family : ParametricQuasiPolynomial or ControlLoop
        What to judge. The other named numbers of a loop keep their values.
    ranges : mapping of str to (low, high) or array_like
        Exactly two names, as in `stability_map`: ranges or the points themselves.
    over : mapping of str to (low, high) or float
        Intervals of one to three other parameters, for example of the delay.
    shape : tuple of int
        Points along each range.
    threads : int, optional
        Number of threads; all cores by default. Results have the same bits for any number.
    progress : callable, optional
        Called now and then with the number of finished cells, and at the end with all.

    Returns
    -------
    RobustMap

    Raises
    ------
    ValueError, TypeError
        As in `stability_map` and `proved_boxes`.

    Examples
    --------
    An integrator whose delay is known to lie between 0.3 s and 0.4 s:

    >>> import deadtime as dtm
    >>> Kp, Kv, T = dtm.parameters("Kp Kv T")
    >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(T)
    >>> chart = dtm.robust_map(
    ...     h, {"Kp": (0.1, 5.9), "Kv": (-0.9, 0.9)}, over={"T": (0.3, 0.4)}, shape=(30, 19)
    ... )
    >>> chart
    <RobustMap Kp 0.1 to 5.9 (30), Kv -0.9 to 0.9 (19) for all T 0.3 to 0.4: 305 of 570 stable>
    """
    axis_names, axes = _axes(ranges, shape)
    held, intervals = _ranges(over)
    twice = [name for name in held if name in axes]
    if twice:
        raise ValueError(f"{twice[0]} is an axis and has an interval: give it one of the two")
    names = (*axis_names, *held)
    native, places = _native(family, names)
    # The points of the axes are put in cell by cell.
    ends = [(0.0, 0.0), (0.0, 0.0), *intervals]
    first, second = axis_names
    unstable = _deadtime.robust_map(
        native,
        _placed(ends, places),
        (places[0], places[1]),
        axes[first],
        axes[second],
        _CELL_BOXES,
        thread_number(threads),
        progress,
    )
    if progress is not None:
        progress(unstable.size)
    for array in (*axes.values(), unstable):
        read_only(array)
    return RobustMap(axis_names, axes, dict(zip(held, intervals, strict=True)), unstable)


def _side(name: str, low: float, high: float) -> str:
    return f"{name} {low:.6g}" if low == high else f"{name} {low:.6g} to {high:.6g}"


def _number(name: str, value: SupportsIndex) -> int:
    try:
        number = operator.index(value)
    except TypeError as error:
        raise TypeError(f"{name}={value!r}: give a whole number") from error
    if not 1 <= number < 2**40:
        raise ValueError(f"{name}={number}: give a whole number of at least 1")
    return number


def _ranges(given: _Given) -> tuple[tuple[str, ...], list[_Range]]:
    """Names and ends of ranges and values."""
    if not isinstance(given, Mapping):
        raise TypeError(f"ranges={given!r}: give a dict such as {{'Kp': (0, 6), 'Kv': (-1, 1)}}")
    if not given:
        raise ValueError("ranges of no parameter: give one to three")
    ends = []
    for name, value in given.items():
        if isinstance(value, (tuple, list, np.ndarray)):
            if len(value) != 2:
                raise ValueError(f"{name}={value!r}: a range is (low, high)")
            low, high = (finite(name, end) for end in value)
            if low > high:
                raise ValueError(
                    f"{name}={value!r}: the low end of a range is not above its high end"
                )
            if math.isinf(high - low):
                raise ValueError(f"{name}={value!r}: the range is wider than 1e308")
        else:
            low = high = finite(name, value)
        ends.append((low, high))
    if sum(low < high for low, high in ends) > _MOST:
        raise ValueError(
            f"ranges for more than {_MOST} parameters ({', '.join(given)}): give the others values"
        )
    return tuple(given), ends


def _native(system: _System, names: tuple[str, ...]) -> tuple[_deadtime.Family, list[int]]:
    """The family in the core, and where it holds each parameter."""
    family = family_of(system, names)
    return family._family, [family.names.index(name) for name in names]


def _inverse(places: list[int]) -> list[int]:
    return [places.index(index) for index in range(len(places))]


def _placed(ends: list[_Range], places: list[int]) -> list[_Range]:
    """The ranges in the order of the family."""
    return [ends[index] for index in _inverse(places)]


def _named(
    what: str,
    given: Mapping[str, SupportsFloat],
    names: tuple[str, ...],
    ranges: Mapping[str, _Range],
) -> dict[str, float]:
    """A point in ranges; parameters with a value need not be named."""
    if not isinstance(given, Mapping):
        raise TypeError(f"{what}={given!r}: give a dict such as {{'Kp': 2.0}}")
    unknown = [name for name in given if name not in names]
    if unknown:
        raise ValueError(f"{what}: {unknown[0]} has no range, but {', '.join(names)}")
    point = {}
    for name in names:
        low, high = ranges[name]
        if name not in given and low < high:
            raise ValueError(f"{what} has no {name}: give {', '.join(names)}")
        point[name] = finite(name, given.get(name, low))
        if not low <= point[name] <= high:
            raise ValueError(f"{what}: {name}={point[name]} lies outside {low} to {high}")
    return point


def _delay_names(system: _System, names: tuple[str, ...]) -> set[str]:
    """Parameters that a delay depends on."""
    family = family_of(system, names)
    return {name for _, _, (_, slopes) in family._terms for name, _ in slopes}
