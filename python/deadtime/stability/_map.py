"""Maps of stability over two parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array, Mask
from deadtime._base.drawing import Axes, shown_axes
from deadtime._base.extras import library
from deadtime._base.frozen import ReadOnlyArrays, read_only
from deadtime._base.notebook import Pictured
from deadtime._base.progress import Progress, reported
from deadtime._base.validation import Points, finite, numbers_at, thread_number
from deadtime.loops import ControlLoop, Explorer, Question, held_plane, numbers_of
from deadtime.roots import HasFamily, ParametricQuasiPolynomial, family_of
from deadtime.stability._arguments import damping_demand, map_axes, sides
from deadtime.stability._boundaries import Boundary, boundaries_along, boundaries_of


class MapStatus(IntEnum):
    """What is known of a cell of a `StabilityMap`."""

    OK = 0
    """Count and abscissa hold."""
    BOUNDARY = 1
    """A root, or a chain of them, lies on the boundary to working precision."""
    CHAIN = 2
    """The chains of roots of a neutral equation determine the abscissa; set only where that is
    computed."""
    INFINITE = 3
    """Infinitely many unstable roots."""
    UNDECIDED = 4
    """Double precision or the limit of work did not suffice."""


@dataclass(frozen=True, eq=False, repr=False)
class StabilityMap(ReadOnlyArrays, Pictured):
    """Stability over two parameters; made by `stability_map`.

    Attributes
    ----------
    names : tuple of str
        The two parameters: first and second axis of the arrays.
    axes : dict of str to ndarray
        Their values, increasing.
    unstable : ndarray of int32, shape (n0, n1)
        Number of unstable roots, counted with multiplicity; -1 for infinitely many, -2 where it
        is not known: a root on the boundary, or undecided.
    abscissa : ndarray of float64, shape (n0, n1)
        Spectral abscissa in 1/s; NaN where it was not computed or is beyond reach.
    status : ndarray of uint8, shape (n0, n1)
        A `MapStatus`.
    decay : float
        Roots right of ``-decay`` count as unstable, 1/s.
    damping : (ratio, horizon) or None
        Roots right of ``-horizon``, 1/s, with a smaller damping ratio count as unstable, too.
    family : ParametricQuasiPolynomial or None
        What was judged; None for a sampled loop.

    Notes
    -----
    All arrays are read-only.
    """

    names: tuple[str, str]
    axes: dict[str, Array]
    unstable: NDArray[np.int32]
    abscissa: Array
    status: NDArray[np.uint8]
    decay: float = 0.0
    damping: tuple[float, float] | None = None
    family: ParametricQuasiPolynomial | None = None
    _loop: ControlLoop | None = None

    @cached_property
    def boundaries(self) -> tuple[Boundary, ...]:
        """Curves on which a root lies on the edge of stability: `Boundary` objects, longest first.

        Those along the rows, and those that run along the rows and are found by the columns. Of a
        sampled loop over one gain alone, the latter may have gaps.

        Raises
        ------
        ValueError
            If neither parameter is a gain and a root stays at 0 whatever they are, or
            the loop is sampled and neither is a gain.

        Examples
        --------
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> Kp, Kv = dtm.parameters("Kp Kv")
        >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
        >>> chart = dtm.stability_map(h, {"Kp": (0.1, 6), "Kv": (-0.5, 0.5)}, abscissa=False)
        >>> curve = chart.boundaries[0]
        >>> len(curve), curve.along, float(curve.omega.min().round(3))
        (101, 'Kp', 2.909)
        >>> bool(np.allclose(curve.values["Kv"], -np.cos(0.36 * curve.omega)))
        True
        """
        if self.family is None and self._loop is not None:
            held = held_plane(self._loop.specification, {}, self.axes)
            return boundaries_along(held.boundaries(self.decay, self.damping), self.axes)
        if self.family is None:
            raise ValueError(
                "this map was made without the family of equations, so its boundaries "
                "cannot be found"
            )
        return boundaries_of(self.family, self.axes, self.decay, self.damping)

    @cached_property
    def chain_abscissa(self) -> Array:
        """Abscissa of the chains of roots in 1/s, shape (n0, n1): -inf without chains.

        Chains are judged robustly, as in `QuasiPolynomial.chain_abscissa`.

        Raises
        ------
        ValueError
            If the map is that of a sampled loop, which has no chains.
        """
        if self.family is None:
            raise ValueError(
                "the map of a sampled loop has no chains, because a sampled loop has finitely "
                "many poles"
            )
        return read_only(self.family._family.chains(self.axes))

    @cached_property
    def strongly_stable(self) -> Mask:
        """Where the chains lie left of ``-decay``, also after small changes of the delays.

        Outside this region no gain helps: infinitely many roots are unstable, or arbitrarily small
        changes of the delays make them so. Shape (n0, n1); true everywhere for retarded families.

        Examples
        --------
        >>> import deadtime as dtm
        >>> Kp, Kv = dtm.parameters("Kp Kv")
        >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
        >>> gains = {"Kp": [1.0], "Kv": [-1.2, 0.0, 0.7, 1.0]}
        >>> chart = dtm.stability_map(h, gains, abscissa=False)
        >>> chart.strongly_stable.tolist()
        [[False, True, True, False]]
        """
        return read_only(self.chain_abscissa < -self.decay)

    @cached_property
    def stable(self) -> Mask:
        """Where no root and no chain of roots is unstable or on the boundary, shape (n0, n1)."""
        known = (self.status == MapStatus.OK) | (self.status == MapStatus.CHAIN)
        stable: Mask = known & (self.unstable == 0)
        stable &= (self.status != MapStatus.CHAIN) | (self.abscissa < -self.decay)
        return read_only(stable)

    def best(self) -> tuple[dict[str, float], float]:
        """Return the stable cell with the smallest spectral abscissa.

        Returns
        -------
        values : dict of str to float
            The two parameters there.
        abscissa : float
            In 1/s.

        Raises
        ------
        ValueError
            If no cell is stable, or the abscissa was not computed.

        Examples
        --------
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> Kp, = dtm.parameters("Kp")
        >>> T, = dtm.parameters("T")
        >>> chart = dtm.stability_map(
        ...     dtm.s + Kp * dtm.delay(T), {"Kp": (0.1, 2.0), "T": (0.5, 1.0)}, shape=(20, 2)
        ... )
        >>> values, abscissa = chart.best()
        >>> {name: round(value, 3) for name, value in values.items()}
        {'Kp': 0.8, 'T': 0.5}
        """
        candidates = np.where(self.stable, self.abscissa, np.nan)
        if not np.isfinite(candidates).any():
            if self.stable.any():
                raise ValueError(
                    "the map contains no abscissa, which is needed to choose the best cell: "
                    "compute it with abscissa=True"
                )
            raise ValueError(
                f"no cell of the map is stable: try other ranges of {' and '.join(self.names)}"
            )
        place = np.unravel_index(int(np.nanargmin(candidates)), candidates.shape)
        values = {
            name: float(self.axes[name][i]) for name, i in zip(self.names, place, strict=True)
        }
        return values, float(candidates[place])

    def plot(
        self,
        ax: Axes | None = None,
        chosen: Mapping[str, float] | None = None,
        show: str | None = None,
    ) -> Axes:
        """Draw the map: its cells, and its boundaries labelled with their frequency in rad/s.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        chosen : mapping of str to float, optional
            Values of the two parameters to mark.
        show : {"abscissa", "counts"}, optional
            What the colours mean: the spectral abscissa of the stable cells (by default, where it
            was computed), or the number of unstable roots.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from deadtime.stability._plots import plot_stability_map

        if show not in (None, "abscissa", "counts"):
            raise ValueError(f"show={show!r}: give 'abscissa' or 'counts'")
        computed = bool(np.isfinite(self.abscissa).any())
        if show == "abscissa" and not computed:
            raise ValueError("the map contains no abscissa to show: compute it with abscissa=True")
        ax = shown_axes(ax)
        plot_stability_map(ax, self, chosen, show or ("abscissa" if computed else "counts"))
        return ax

    def explore(self) -> Explorer:
        """Return a page that shows this map live: see `deadtime.ControlLoop.explore`.

        Returns
        -------
        deadtime.loops.Explorer

        Raises
        ------
        ValueError
            If the map is not that of a `ControlLoop`, or the explorer has no such loop or axis.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.5, 0.1), delay=0.36)
        >>> chart = dtm.stability_map(loop, {"Kp": (0, 6), "Kv": (-0.9, 0.9)}, abscissa=False)
        >>> chart.explore().state["y"]
        'Kv'
        """
        if self._loop is None:
            raise ValueError(
                "the explorer shows only maps of a ControlLoop, but this map was made from "
                "another family"
            )
        ends = {name: (float(axis[0]), float(axis[-1])) for name, axis in self.axes.items()}
        return self._loop.explore(ends)

    def to_xarray(self) -> Any:
        """Return the arrays as an `xarray.Dataset` with the parameters as coordinates.

        Returns
        -------
        xarray.Dataset
            Variables ``unstable``, ``abscissa``, ``status`` and ``stable``.

        Raises
        ------
        MissingExtraError
            If xarray is not installed.
        """
        xarray = library("xarray", "to_xarray()", "xarray")
        arrays = {
            name: getattr(self, name) for name in ("unstable", "abscissa", "status", "stable")
        }
        data = xarray.Dataset(
            {name: (self.names, array) for name, array in arrays.items()}, coords=self.axes
        )
        data["abscissa"].attrs["units"] = "1/s"
        return data

    def __repr__(self) -> str:
        stable = f"{int(self.stable.sum())} of {self.stable.size} stable"
        return f"<StabilityMap {sides(self.axes)}: {stable}>"


def stability_map(
    family: HasFamily,
    ranges: Mapping[str, Points],
    shape: tuple[int, int] = (101, 101),
    *,
    at: Mapping[str, SupportsFloat] | None = None,
    abscissa: bool = True,
    decay: float = 0.0,
    damping: tuple[float, float] | None = None,
    proof: str = "curves",
    threads: int | None = None,
    progress: Progress = False,
) -> StabilityMap:
    """Stability over two parameters: number of unstable roots and spectral abscissa in each cell.

    Parameters
    ----------
    family : ParametricQuasiPolynomial, ControlLoop, TransferFunction or DelaySystem
        What to judge, with the names that `deadtime.crossings` knows. The limit of a loop plays no
        part in stability.
    ranges : mapping of str to (low, high), (low, high, n) or ndarray
        Exactly two names. A range is sampled at n points, both ends included, or at as many as
        `shape` says; an array holds the points themselves, increasing. The first name is the first
        axis of the results.
    shape : tuple of int
        Points along each range that does not say how many it has.
    at : mapping of str to float, optional
        Values of the other parameters; those of a loop have values, which these replace.
    abscissa : bool
        Compute the spectral abscissa too, at several times the cost of the counts.
    decay : float
        Stable means that every root has a real part below ``-decay``, in 1/s.
    damping : (ratio, horizon), optional
        Stable also means that every root with a real part above ``-horizon``, in 1/s, has a
        damping ratio ``-Re s/abs(s)`` of at least `ratio`. (Faster ones are let go: a loop with a
        delay has infinitely many of them, with damping ratios down to 0.)
    proof : {"curves", "cells"}
        How cells are proved: by all crossings of the boundary along each row of cells and one
        count for every row, or each cell by itself. Both give the same counts; the second is a
        check of the first, hundreds of times slower. Where neither parameter is a gain or the
        delay of some terms, blocks of cells are proved to have no boundary in them, and the
        abscissa is searched in each cell by itself.
    threads : int, optional
        Number of threads; all cores by default. Results have the same bits for any number.
    progress : bool or callable
        True for a progress bar; or called now and then with the number of finished cells, and at
        the end with all.

    Returns
    -------
    StabilityMap

    Raises
    ------
    ValueError
        If a name is unknown or another parameter has no value, a range is empty, not increasing or
        not finite, a delay would be negative, or there are more than 50 million cells.
    TypeError
        If `family` is something else, or a range is not made of numbers.

    Notes
    -----
    Continuous: a root is unstable right of the imaginary axis; their number is proved by the
    argument principle, and equals the pointwise ``family.at(...).count(re=(0, None))``. Chains of
    roots of neutral equations are judged robustly, as under arbitrarily small changes of the
    delays [1]_.

    Sampled: the poles are s = ln(z)/Ts, z the zeros of a polynomial of the loop, hold and delay
    included; unstable is outside the circle of radius exp(-decay Ts), and the abscissa is
    ln(rho)/Ts with rho the largest modulus. Their number is proved by the same principle on the
    circle.

    References
    ----------
    .. [1] J. K. Hale and S. M. Verduyn Lunel, "Strong stabilization of neutral functional
       differential equations", IMA Journal of Mathematical Control and Information 19 (2002).

    Examples
    --------
    >>> import deadtime as dtm
    >>> Kp, Kv = dtm.parameters("Kp Kv")
    >>> h = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
    >>> dtm.stability_map(h, {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}, shape=(60, 37))
    <StabilityMap Kp 0.1 to 6 (60), Kv -0.9 to 0.9 (37): 1321 of 2220 stable>
    """
    axes = map_axes(ranges, shape)
    names = first, second = tuple(axes)
    fixed = numbers_at(at, names)
    threads = thread_number(threads)
    if proof not in ("curves", "cells"):
        raise ValueError(f"proof={proof!r}: give 'curves' or 'cells'")
    question = Question(bool(abscissa), finite("decay", decay), damping_demand(damping), proof)
    size = len(axes[first]), len(axes[second])
    judged: ParametricQuasiPolynomial | None = None
    with reported(progress, math.prod(size)) as report:
        if isinstance(family, ControlLoop) and family.is_sampled:
            numbers_of(family.parameters, (*names, *fixed))
            held = held_plane(family.specification, fixed, axes)
            cells = held.cells(question, threads=threads, progress=report)
        else:
            judged = family_of(family, names, fixed)
            cells = judged._family.map(axes, question, threads=threads, progress=report)
        missing = np.broadcast_to(np.float64(np.nan), size)
        alpha = missing if cells.abscissa is None else cells.abscissa
        if report is not None:
            report(math.prod(size))
    loop = family if isinstance(family, ControlLoop) else None
    return StabilityMap(
        (first, second),
        axes,
        cells.unstable,
        alpha,
        cells.status,
        question.decay,
        question.damping,
        judged,
        loop.replace(**fixed) if loop is not None and fixed else loop,
    )
