"""Roots of det M(s) from the matrices themselves, with the methods of a quasi-polynomial.

M(s) = s E + sum (s N_j - A_j) e^{-s tau_j} is factorised at each point of a contour; nothing is
expanded, so that the number of states and the size of coefficients do not matter.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from deadtime import _deadtime
from deadtime._base.ranges import OpenRange, open_interval
from deadtime.roots._root_set import RootSet, root_set

__all__ = ["MatrixDeterminant"]

_Matrix = NDArray[np.float64]


class MatrixDeterminant:
    """The determinant of a characteristic matrix, never expanded."""

    __slots__ = ("_native",)

    _native: _deadtime.CharacteristicMatrix

    def __init__(self, E: _Matrix, N: Mapping[float, _Matrix], A: Mapping[float, _Matrix]) -> None:
        def listed(group: Mapping[float, _Matrix]) -> list[tuple[float, _Matrix]]:
            return [(tau, np.ascontiguousarray(matrix)) for tau, matrix in group.items()]

        self._native = _deadtime.CharacteristicMatrix(np.ascontiguousarray(E), listed(N), listed(A))

    @property
    def is_invertible(self) -> bool:
        """Whether the inverse of E can be verified."""
        return self._native.is_invertible()

    def count(self, re: OpenRange | None = None, im: OpenRange | None = None) -> int:
        """Count the roots in a region, with multiplicity, and prove the number."""
        return self._native.count(open_interval("re", re), open_interval("im", im))

    def roots(self, re: OpenRange | None = None, im: OpenRange | None = None) -> RootSet:
        """Locate every root in a region, each in a disc proved to hold it."""
        return root_set(self._native.roots(open_interval("re", re), open_interval("im", im)))

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost roots, right of the chains of a neutral system."""
        number = operator.index(n)
        if number < 1:
            raise ValueError(f"n={n}: ask for at least 1 rightmost root")
        return root_set(self._native.rightmost(number))

    def spectral_abscissa(self) -> float:
        """Give the largest real part of a root, or that of the chains."""
        return self._native.spectral_abscissa()

    def chain_enclosure(self) -> tuple[float, float]:
        """Lower and upper bound of the real part that chains come to, delays free to vary."""
        return self._native.chain_abscissa()

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every root is proved to lie left of the imaginary axis."""
        stable = self._native.is_stable()
        if stable or strong or self.chain_enclosure()[1] < 0.0:
            return stable
        raise ValueError(
            "strong=False: with its delays taken as exact, a neutral system is only told from its "
            "expanded determinant, which this one does not have; it is not strongly stable"
        )
