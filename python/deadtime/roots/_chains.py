r"""Chains: the laws that the roots of large modulus follow.

Where e^(-Re s) = |s|^mu, the row with delay tau and degree n is of the size |s|^(n + mu tau). Two
rows or more can only cancel where they are largest together: on an edge of the upper convex hull
of the points (tau, n), with mu minus its slope (Bellman and Cooke 1963, chapter 12). With b_j the
leading coefficients there, d_j the delays less the first of the edge, and v = s + mu log s, the
sum of these rows is the first of them times

    D(v) = sum_j b_j e^(-v d_j),

so that s + mu log s -> v for roots v of D. If the d_j are whole multiples of a base, D is a
polynomial in z = e^(-v base), and each of its roots z makes one chain in the upper half plane,
v = (2 pi i k - log z) / base; else the roots of D are located one by one. What is left out are
the lower powers of s and the other rows: of relative size 1/|s|, or a power of it if another row
is almost as large.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.arrays import Array, Complex
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.validation import real_array, unmasked

#: Distance from an edge, in degrees of a polynomial, below which a point counts as on it.
_ON_EDGE = 1e-9
#: Largest denominator of the fractions of the least delay that are tried as its common measure.
_MAX_DENOMINATOR = 64
#: Largest degree of the polynomial in z whose roots are computed, one for each chain.
_MAX_DEGREE = 128


class Function(Protocol):
    """What the laws of chains take from a quasi-polynomial, and from their difference part."""

    @property
    def coefficients(self) -> Array: ...

    @property
    def delays(self) -> Array: ...

    def roots(self, *, im: tuple[float, float] | None = None) -> Any: ...

    def chain_abscissa(self) -> float: ...


#: Makes a function from coefficients and delays.
Make: TypeAlias = Callable[[Any, Any], Function]


@dataclass(frozen=True, eq=False)
class Chain(ReadOnlyArrays):
    r"""A sequence of characteristic roots going to infinity, and its law.

    Made by `QuasiPolynomial.chains`. In the upper half plane; the mirror image is another one.

    Attributes
    ----------
    kind : str
        'retarded' (bends to the left), 'neutral' (runs along a vertical line) or 'advanced'
        (bends to the right).
    bend : float
        mu in 1/s: :math:`\mathrm{Re}\, s \approx c - \mu \ln|s|`; positive for a retarded chain,
        0 for a neutral one.
    offset : float
        c in 1/s. For a chain that is not periodic the largest that roots come to.
    spacing : float
        Difference of the imaginary parts of neighbours, in rad/s; their mean where the chain is
        not periodic.
    multiplicity : int
        Number of roots that come together at each place far out.
    periodic : bool
        Is there one offset for all roots? Not so where three or more rows of the same edge have
        delays without a common base: the chain then fills a strip.
    """

    kind: Literal["retarded", "neutral", "advanced"]
    bend: float
    offset: float
    spacing: float
    multiplicity: int
    periodic: bool
    _phase: float = field(repr=False)
    _difference: Function | None = field(default=None, repr=False)

    def real_part(self, im: ArrayLike) -> Array:
        """Real part of the law at given heights.

        Parameters
        ----------
        im : array_like of float
            Imaginary parts in rad/s, not 0 unless the chain is neutral.

        Returns
        -------
        ndarray of float, shape of `im`
        """
        y = real_array("im", im)
        x = np.full(y.shape, self.offset)
        if self.bend == 0.0:
            return x
        with np.errstate(divide="ignore"):
            for _ in range(60):
                # Damped where the chain is still close to the origin.
                x = 0.5 * (x + self.offset - self.bend * np.log(np.hypot(x, y)))
        return x

    @overload
    def starts(self, n: int) -> complex: ...
    @overload
    def starts(self, n: ArrayLike) -> Complex: ...
    def starts(self, n: Any) -> Any:
        """Approximate roots: where Newton's iteration may start.

        Parameters
        ----------
        n : int or array_like of int
            Which ones, counted upwards from 0 next to the real axis.

        Returns
        -------
        complex or ndarray of complex, shape of `n`
            In 1/s. Their error falls with n, as ``1/abs(s)`` or a power of it: a small power, hence
            late, where the bends of two chains are almost the same.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> h = s + delay(1.0)
        >>> (chain,) = h.chains()
        >>> z = chain.starts(100)
        >>> root = h.roots(re=(-12, 2), im=(z.imag - 3, z.imag + 3))[0]
        >>> bool(abs(z - root) < 1e-2)
        True
        """
        index = np.asarray(unmasked("n", n))
        if index.dtype.kind not in "iu":
            raise TypeError(f"n has the dtype {index.dtype}: give whole numbers")
        if index.size and index.min() < 0:
            raise ValueError(f"n={index.min()}: roots are numbered from 0, so give 0 or more")
        if self._difference is None:
            v = self.offset + 1j * (self._phase + self.spacing * index)
        else:
            v = self._located(index)
        s = v - 0.5j * math.pi * self.bend
        if self.bend != 0.0:
            s = np.where(np.abs(s) < abs(self.bend), 1j * abs(self.bend), s)
            for _ in range(60):
                # Newton's iteration for s + mu log s = v.
                s = s - (s + self.bend * np.log(s) - v) / (1.0 + self.bend / s)
        return s if index.ndim else complex(s)

    def _located(self, index: NDArray[np.int64]) -> Complex:
        """Roots of the difference part, by height, above the foot of the chain."""
        assert self._difference is not None
        foot = 0.5 * math.pi * max(self.bend, 0.0)
        most = int(index.max()) + 1 if index.size else 1
        height = foot + self.spacing * (most + 2)
        while True:
            found = self._difference.roots(im=(-height, height))
            above = np.repeat(found.roots, found.multiplicities)
            above = above[above.imag >= foot]
            above = above[np.argsort(above.imag)]
            if len(above) >= most:
                return np.asarray(above[index])
            height *= 1.5


def chains_of(h: Function) -> tuple[Chain, ...]:
    """All chains of `h`, from the least bend to the largest."""
    points: list[_Point] = []
    for tau, row in zip(h.delays.tolist(), h.coefficients, strict=True):
        if np.any(row):
            n = int(np.flatnonzero(row)[-1])
            points.append((tau, n, float(row[n])))
    chains: list[Chain] = []
    for edge in _edges(points):
        chains += _chains_of_edge(edge, type(h))
    return tuple(chains)


_Point: TypeAlias = tuple[float, int, float]


def _edges(points: list[_Point]) -> Iterator[list[_Point]]:
    """Edges of the upper hull from left to right, each with all points on it."""
    first = 0
    while first < len(points) - 1:
        tau, n, _ = points[first]
        slopes = [(m - n) / (other - tau) for other, m, _ in points[first + 1 :]]
        steepest = max(slopes)
        # How far a point of the edge is off, in degrees.
        on = [
            first + 1 + i
            for i, (slope, (other, _, _)) in enumerate(
                zip(slopes, points[first + 1 :], strict=True)
            )
            if (steepest - slope) * (other - tau) <= _ON_EDGE
        ]
        yield [points[first], *(points[i] for i in on)]
        first = on[-1]


def _chains_of_edge(edge: list[_Point], make: Make) -> Iterator[Chain]:
    (tau, n, _), (last, m, _) = edge[0], edge[-1]
    span = last - tau
    bend = (n - m) / span
    kind: Literal["retarded", "neutral", "advanced"] = (
        "neutral" if n == m else "retarded" if n > m else "advanced"
    )
    gaps = [other - tau for other, _, _ in edge]
    sizes = [b for _, _, b in edge]
    base = _common_base(gaps)
    if base is None or round(span / base) > _MAX_DEGREE:
        difference = make([[b] for b in sizes], gaps)
        offset = difference.chain_abscissa()
        yield Chain(kind, bend, offset, math.tau / span, 1, False, 0.0, difference)
        return
    spacing = math.tau / base
    for z, multiplicity in _roots_in_z(sizes, [round(gap / base) for gap in gaps], make):
        offset = -math.log(abs(z)) / base
        phase = -math.atan2(z.imag, z.real) / base
        # The first one whose root s has an imaginary part that is not negative.
        foot = 0.5 * math.pi * bend
        phase += spacing * math.ceil((foot - phase) / spacing - 1e-9)
        yield Chain(kind, bend, offset, spacing, multiplicity, True, phase)


def _roots_in_z(sizes: list[float], powers: list[int], make: Make) -> Iterator[tuple[complex, int]]:
    """Roots of a polynomial with few terms, and their multiplicities."""
    if len(sizes) == 2:
        yield complex(-sizes[0] / sizes[1]), 1
        return
    ascending = np.zeros(powers[-1] + 1)
    ascending[powers] = sizes
    # Proved multiplicities: rounding splits an m-fold root by the m-th root of an ulp.
    found = make([ascending], [0.0]).roots()
    yield from zip(found, found.multiplicities.tolist(), strict=True)


def _common_base(gaps: list[float]) -> float | None:
    """The largest number of which all `gaps` are whole multiples to rounding."""
    for q in range(1, _MAX_DENOMINATOR + 1):
        base = gaps[1] / q
        multiples = np.array(gaps) / base
        if np.all(np.abs(multiples - np.round(multiples)) <= 8 * np.finfo(float).eps * multiples):
            return base
    return None
