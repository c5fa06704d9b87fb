"""Roots of det M(s) from the matrices themselves, with the methods of a quasi-polynomial.

M(s) = s E + sum (s N_j - A_j) e^{-s tau_j} is factorised at each point of a contour. The
determinant is not expanded, so that the accuracy does not depend on the number of states or on the
size of coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

import deadtime.roots._native as native
from deadtime._base.arrays import Array
from deadtime._base.validation import OpenRange, open_interval, whole_number
from deadtime.roots._root_set import RootSet, root_set
from deadtime.roots.certificate._certificate import Certificate

_NOT_EXACT = (
    "with its delays taken as exact, a neutral system is judged by its expanded determinant, which "
    "this one does not have"
)


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
        """Whether E is proved to be invertible."""
        return self._native.is_invertible()

    def count(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: str = "error"
    ) -> int:
        """Count the roots in a region, with multiplicity, and prove the number."""
        _refuse_edge(edge)
        return self._native.count(open_interval("re", re), open_interval("im", im))

    def certify(self, re: OpenRange | None = None, im: OpenRange | None = None) -> Certificate:
        """Raise ValueError: a certificate needs the coefficients of an expanded determinant."""
        raise ValueError(
            "a certificate needs the expanded determinant, which this system does not have: "
            "count() proves the same number without writing the proof down"
        )

    def roots(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: str = "error"
    ) -> RootSet:
        """Locate every root in a region, each in a disc proved to contain it."""
        _refuse_edge(edge)
        return root_set(self._native.roots(open_interval("re", re), open_interval("im", im)))

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost roots, right of the chains of a neutral system."""
        return root_set(self._native.rightmost(whole_number("n", n)))

    def rightmost_from_guesses(self, n: int) -> RootSet | None:
        """Locate simple rightmost roots where guesses lead to them, or give None."""
        found = self._native.rightmost_from_guesses(n)
        return None if found is None else root_set(found)

    def spectral_abscissa(self, strong: bool = True) -> float:
        """Give the largest real part of a root, or that of the chains."""
        found = self._native.spectral_abscissa()
        if strong or found > self.chain_enclosure()[1]:
            return found
        raise ValueError(f"strong=False: {_NOT_EXACT}; its strong abscissa is {found:.6g} 1/s")

    def chain_enclosure(self) -> tuple[float, float]:
        """Lower and upper bound on the chain abscissa for arbitrarily small changes of delays."""
        return self._native.chain_abscissa()

    def chain_abscissa(self, strong: bool = True) -> float:
        """Give the upper end of `chain_enclosure`."""
        found = self.chain_enclosure()[1]
        if strong or found == -math.inf:
            return found
        raise ValueError(f"strong=False: {_NOT_EXACT}; its strong abscissa is {found:.6g} 1/s")

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every root is proved to lie left of the imaginary axis."""
        stable = self._native.is_stable()
        if stable or strong or self.chain_enclosure()[1] < 0.0:
            return stable
        raise ValueError(f"strong=False: {_NOT_EXACT}; it is not strongly stable")


def _refuse_edge(edge: str) -> None:
    if edge != "error":
        raise ValueError(
            f"edge={edge!r}: roots on the edge of a region are told apart by the expanded "
            "determinant, which this system does not have; move the edge"
        )
