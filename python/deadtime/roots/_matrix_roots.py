"""Roots of det M(s) from the matrices themselves, with the methods of a quasi-polynomial.

M(s) = s E + sum (s N_j - A_j) e^{-s tau_j} is factorised at each point of a contour. The
determinant is not expanded, so that the accuracy does not depend on the number of states or on the
size of coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import deadtime.roots._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import ContourError, CountMismatchError
from deadtime._base.validation import OpenRange, open_interval, whole_number
from deadtime.roots._characteristic import Edge
from deadtime.roots._quasipolynomial import QuasiPolynomial
from deadtime.roots._root_set import RootSet, rightmost_set, root_set

#: Least half-width of the square in which a root is counted again, relative to its modulus. Larger:
#: other roots may be inside; smaller: roots that rounding has moved may be outside.
_AROUND = 1e-7


class MatrixDeterminant:
    """The determinant of a characteristic matrix that is not expanded."""

    __slots__ = ("_native",)

    _native: native.CharacteristicMatrix

    def __init__(self, E: Array, N: Mapping[float, Array], A: Mapping[float, Array]) -> None:
        def listed(group: Mapping[float, Array]) -> list[tuple[float, Array]]:
            return [(tau, np.ascontiguousarray(matrix)) for tau, matrix in group.items()]

        self._native = native.CharacteristicMatrix(np.ascontiguousarray(E), listed(N), listed(A))

    @property
    def is_invertible(self) -> bool:
        """Whether E is proved to be invertible, block by block."""
        return self._native.is_invertible()

    def count(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> int:
        """Count the roots in a region, with multiplicity, and prove the number."""
        return self._native.count(open_interval("re", re), open_interval("im", im), edge)

    def roots(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> RootSet:
        """Locate every root in a region, each in a disc proved to contain it."""
        return root_set(self._native.roots(open_interval("re", re), open_interval("im", im), edge))

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost roots, right of the chains of a neutral system."""
        n = whole_number("n", n)
        return rightmost_set(self._native.rightmost(n), n, self.chain_abscissa)

    def spectral_abscissa(self, strong: bool = True) -> float:
        """Give the largest real part of a root, or that of the chains."""
        return self._native.spectral_abscissa(strong)

    def chain_enclosure(self) -> tuple[float, float]:
        """Lower and upper bound on the chain abscissa for arbitrarily small changes of delays."""
        return self._native.chain_abscissa(True)

    def chain_abscissa(self, strong: bool = True) -> float:
        """Give the upper end of `chain_enclosure`."""
        return self._native.chain_abscissa(strong)[1]

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every root is proved to lie left of the imaginary axis."""
        return self._native.is_stable(strong)


class RoundedExpansion:
    """An expanded determinant with rounded coefficients, for what the matrix does not answer.

    A root counts only if the matrix has as many roots next to it. Which side of an edge a root is
    on, the rounded coefficients do not tell.
    """

    def __init__(self, h: QuasiPolynomial, matrix: MatrixDeterminant, why: Exception) -> None:
        self._h, self._matrix, self._why = h, matrix, why

    def count(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> int:
        """Raise the error of the matrix."""
        raise self._why

    def roots(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> RootSet:
        """Raise the error of the matrix."""
        raise self._why

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost roots, right of the chains of a neutral system."""
        found = self._h.rightmost(n)
        parts = zip(found.roots, found.multiplicities, self._halves(found), strict=True)
        for root, number, half in parts:
            re, im = ((x - half, x + half) for x in (root.real, root.imag))
            try:
                confirmed = self._matrix.count(re, im) == number
            except ContourError:
                confirmed = False
            if not confirmed:
                raise CountMismatchError(
                    f"the expanded determinant has {number} poles at {root:.6g}, but within "
                    f"{half:.1e} of this place the matrices do not have as many. Coefficients "
                    "of the determinant are rounded, and these poles are too close together "
                    "for double precision",
                    int(number),
                    [],
                )
        return found

    def spectral_abscissa(self, strong: bool = True) -> float:
        """Give the largest real part of a root, or that of the chains."""
        self.rightmost()
        return self._h.spectral_abscissa(strong)

    def chain_abscissa(self, strong: bool = True) -> float:
        """Give the real part that chains of roots can come to."""
        return self._h.chain_abscissa(strong)

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every root is proved to lie left of the imaginary axis."""
        found = self.rightmost()
        left = bool(np.all(found.roots.real + self._halves(found) < 0.0))
        return left and self._h.is_stable(strong)

    def _halves(self, found: RootSet) -> Array:
        """Halves of the sides of the squares in which the matrix has to have the same roots."""
        return 2.0 * found.radii + _AROUND * np.abs(found.roots)
