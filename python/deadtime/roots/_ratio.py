"""Poles of a ratio of quasi-polynomials: the roots of the denominator that it does not share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

import deadtime.roots._native as native
from deadtime._base.validation import OpenRange, open_interval, whole_number
from deadtime.roots._characteristic import Edge
from deadtime.roots._quasipolynomial import QuasiPolynomial
from deadtime.roots._root_set import RootSet, rightmost_set, root_set


class Ratio:
    """n/d, with the questions of a quasi-polynomial about its poles.

    A root of d counts where n has no root, or one of lower multiplicity. n has one where its value,
    and as many derivatives as needed, are zero within the rounding of coefficients and delays.
    """

    __slots__ = ("_d", "_native")

    def __init__(self, n: QuasiPolynomial, d: QuasiPolynomial) -> None:
        self._d = d
        self._native = native.Ratio(n._native, d._native)

    def count(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> int:
        """Count the poles in a region, with multiplicity."""
        return self._native.count(open_interval("re", re), open_interval("im", im), edge)

    def roots(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> RootSet:
        """Locate every pole in a region, and the hidden roots of d."""
        return root_set(self._native.poles(open_interval("re", re), open_interval("im", im), edge))

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost poles, and the hidden roots of d among them."""
        n = whole_number("n", n)
        return rightmost_set(self._native.rightmost(n), n, self.chain_abscissa)

    def spectral_abscissa(self, strong: bool = True) -> float:
        """Give the largest real part of a pole, or that of the chains; -inf without either."""
        if self._d.kind == "advanced":
            return math.inf
        return self._native.spectral_abscissa(bool(strong))

    def chain_abscissa(self, strong: bool = True) -> float:
        """Give the real part that chains of roots of d can come to."""
        return self._d.chain_abscissa(strong)

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every pole is proved to lie left of the imaginary axis."""
        return self._native.stability(bool(strong))[0]

    def hidden_unstable(self) -> NDArray[np.complex128]:
        """List the hidden roots not left of the axis on which a verdict of stability rests."""
        return self._native.stability(True)[1]
