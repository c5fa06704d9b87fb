"""Maps over two parameters that hold for all values of others in intervals: proved."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import SupportsFloat

import numpy as np
from numpy.typing import NDArray

import deadtime.stability._native as native
from deadtime._base.arrays import Array, Mask
from deadtime._base.drawing import Axes, shown_axes
from deadtime._base.frozen import ReadOnlyArrays, read_only
from deadtime._base.notebook import Pictured
from deadtime._base.progress import Progress, reported
from deadtime._base.validation import Points, Range, thread_number
from deadtime.roots import HasFamily, family_of
from deadtime.stability._arguments import Given, map_axes, ranges_of, side, sides

#: Upper limit on the boxes of one cell of a robust map (bounds time); a cell that needs more is
#: undecided.
_CELL_BOXES = 1000


@dataclass(frozen=True, eq=False, repr=False)
class RobustMap(ReadOnlyArrays, Pictured):
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
    axes: dict[str, Array]
    over: dict[str, Range]
    unstable: NDArray[np.int32]

    @cached_property
    def stable(self) -> Mask:
        """Where all members are proved stable, shape (n0, n1)."""
        return read_only(self.unstable == 0)

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
        from deadtime.stability._plots import plot_robust_map

        return plot_robust_map(shown_axes(ax), self)

    def __repr__(self) -> str:
        held = ", ".join(side(name, *self.over[name]) for name in self.over)
        stable = f"{int(self.stable.sum())} of {self.stable.size} stable"
        return f"<RobustMap {sides(self.axes)} for all {held}: {stable}>"


def robust_map(
    family: HasFamily,
    ranges: Mapping[str, Points],
    over: Given,
    shape: tuple[int, int] = (101, 101),
    *,
    at: Mapping[str, SupportsFloat] | None = None,
    threads: int | None = None,
    progress: Progress = False,
) -> RobustMap:
    """Stability over two parameters, proved for every value of others in intervals.

    Parameters
    ----------
    family : ParametricQuasiPolynomial, ControlLoop, TransferFunction or DelaySystem
        What to judge, with the names that `deadtime.crossings` knows.
    ranges : mapping of str to (low, high), (low, high, n) or ndarray
        Exactly two names, as in `stability_map`: ranges or the points themselves.
    over : mapping of str to (low, high)
        Intervals of one to three other parameters, for example of the delay.
    shape : tuple of int
        Points along each range that does not say how many it has.
    at : mapping of str to float, optional
        Values of the other parameters; those of a loop have values, which these replace.
    threads : int, optional
        Number of threads; all cores by default. Results have the same bits for any number.
    progress : bool or callable
        True for a progress bar; or called now and then with the number of finished cells, and at
        the end with all.

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
    axes = map_axes(ranges, shape)
    first, second = axes
    held = ranges_of(over)
    twice = [name for name in held if name in axes]
    if twice:
        raise ValueError(f"{twice[0]} has both an axis and an interval: give only one of the two")
    known = family_of(family, (first, second, *held), at)
    cells = math.prod(len(points) for points in axes.values())
    with reported(progress, cells) as report:
        unstable = native.robust_map(
            known._family,
            axes,
            held,
            max_boxes=_CELL_BOXES,
            threads=thread_number(threads),
            progress=report,
        )
        if report is not None:
            report(cells)
    return RobustMap((first, second), axes, held, unstable)
