"""Boxes of gains and delays that are proved stable.

Not sampled: every member of such a box has the stated number of unstable roots. The number of
roots right of the imaginary axis changes only where a root lies on the axis or comes from
infinity; both are excluded for all members of a box at once, and the roots of one are counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike, NDArray

import deadtime.stability._native as native
from deadtime._base.arrays import Array
from deadtime._base.drawing import Axes, shown_axes
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.progress import Progress, reported
from deadtime._base.validation import (
    Range,
    finite,
    positive,
    real_array,
    thread_number,
    whole_number,
)
from deadtime.roots import HasFamily, family_of
from deadtime.stability._arguments import Given, ranges_of, side


@dataclass(frozen=True, eq=False, repr=False)
class ProvedBoxes(ReadOnlyArrays, Pictured):
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
    ranges: dict[str, Range]
    low: Array
    high: Array
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
                    f"points has shape {array.shape}: give an array whose last axis contains "
                    f"{', '.join(self.names)}"
                )
        else:
            wrong = [name for name in values if name not in self.names]
            wrong += [name for name in self.names if name not in values]
            if wrong:
                raise ValueError(
                    f"{wrong[0]} is missing or unknown: give exactly {', '.join(self.names)}"
                )
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
        from deadtime.stability._plots import plot_boxes

        return plot_boxes(shown_axes(ax), self)

    def __repr__(self) -> str:
        sides = ", ".join(side(name, *self.ranges[name]) for name in self.names)
        return (
            f"<ProvedBoxes {sides}: {len(self.unstable)} boxes, {100 * self.stable_share:.4g} % "
            f"stable, {100 * self.undecided:.3g} % undecided>"
        )


def proved_boxes(
    family: HasFamily,
    ranges: Given,
    tol: float = 1e-3,
    *,
    at: Mapping[str, SupportsFloat] | None = None,
    max_boxes: int = 1_000_000,
    threads: int | None = None,
    progress: Progress = False,
) -> ProvedBoxes:
    """Divide ranges of gains and delays into boxes that are proved stable or unstable.

    Parameters
    ----------
    family : ParametricQuasiPolynomial, ControlLoop, TransferFunction or DelaySystem
        What to judge, with the names that `deadtime.crossings` knows.
    ranges : mapping of str to (low, high)
        One to three ranges.
    tol : float
        Share of the ranges that may stay undecided, from 0 to 1. The number of boxes grows like
        1/tol for two parameters and 1/tol**2 for three.
    at : mapping of str to float, optional
        Values of the other parameters; those of a loop have values, which these replace.
    max_boxes : int
        The division ends with this many boxes (some hundred bytes each), whatever is undecided
        then; `ProvedBoxes.undecided` says how much.
    threads : int, optional
        Number of threads; all cores by default. Results have the same bits for any number.
    progress : bool or callable
        True for a progress bar; or called now and then with the number of boxes looked at.

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
    ends = ranges_of(ranges)
    share = finite("tol", tol)
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"tol={share}: give a share of the ranges, between 0 and 1")
    with reported(progress) as report:
        found = native.proved_boxes(
            family_of(family, tuple(ends), at)._family,
            ends,
            tol=share,
            max_boxes=whole_number("max_boxes", max_boxes),
            threads=thread_number(threads),
            progress=report,
        )
        if report is not None:
            report(len(found.parameter))
    return ProvedBoxes(
        names=tuple(ends),
        ranges=ends,
        low=found.low,
        high=found.high,
        unstable=found.unstable,
        undecided=max(found.undecided, 0.0),
        _tree={"parameter": found.parameter, "at": found.at, "link": found.link},
    )


def largest_stable_box(
    family: HasFamily,
    ranges: Given,
    *,
    at: Mapping[str, SupportsFloat] | None = None,
    around: Mapping[str, SupportsFloat] | None = None,
    tol: float = 1e-3,
    threads: int | None = None,
    progress: Progress = False,
) -> dict[str, Range]:
    """Find one large box of gains and delays all of which is proved stable.

    Parameters
    ----------
    family : ParametricQuasiPolynomial, ControlLoop, TransferFunction or DelaySystem
        What to judge, with the names that `deadtime.crossings` knows.
    ranges : mapping of str to (low, high)
        As in `proved_boxes`. Volumes are measured relative to them.
    at : mapping of str to float, optional
        Values of the other parameters; those of a loop have values, which these replace.
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
    ends = ranges_of(ranges)
    step = positive("tol", tol)
    with reported(progress) as report:
        found = native.largest_stable_box(
            family_of(family, tuple(ends), at)._family,
            ends,
            around=None if around is None else _point(around, ends),
            tol=step,
            threads=thread_number(threads),
            progress=report,
        )
    if found is None:
        held = "" if around is None else f" around {dict(around)}"
        raise ValueError(
            f"no stable box{held} was found in "
            + ", ".join(side(name, *end) for name, end in ends.items())
            + ": try other ranges"
        )
    return found


def _point(given: Mapping[str, SupportsFloat], ranges: Mapping[str, Range]) -> dict[str, float]:
    """A point in ranges; parameters with a value need not be named."""
    if not isinstance(given, Mapping):
        raise TypeError(f"around={given!r}: give a dict such as {{'Kp': 2.0}}")
    unknown = [name for name in given if name not in ranges]
    if unknown:
        raise ValueError(
            f"around: {unknown[0]} has no range. Ranges are given for {', '.join(ranges)}"
        )
    point = {}
    for name, (low, high) in ranges.items():
        if name not in given and low < high:
            raise ValueError(f"the point around= has no value for {name}: give {', '.join(ranges)}")
        point[name] = finite(name, given.get(name, low))
        if not low <= point[name] <= high:
            raise ValueError(
                f"around: {name}={point[name]} is outside of its range, {low} to {high}"
            )
    return point
