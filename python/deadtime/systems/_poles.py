"""The questions about poles that every system answers, passed on to its characteristic function."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from typing import SupportsFloat, TypeAlias, TypeVar

from deadtime._base.validation import OpenRange, Range
from deadtime.roots import (
    Certificate,
    Crossings,
    Edge,
    MatrixDeterminant,
    ParametricQuasiPolynomial,
    QuasiPolynomial,
    Ratio,
    RootSet,
    RoundedExpansion,
    crossings,
)

T = TypeVar("T")

#: What answers the questions.
Determinant: TypeAlias = QuasiPolynomial | Ratio | MatrixDeterminant | RoundedExpansion


class HasPoles(ABC):
    """Base of systems; the poles are the roots of what is asked."""

    __slots__ = ()

    @abstractmethod
    def _ask(self, question: Callable[[Determinant], T]) -> T:
        """Ask the characteristic function."""

    @abstractmethod
    def _exactly(self) -> QuasiPolynomial:
        """Give the characteristic function without rounding."""

    @abstractmethod
    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial:
        """Give the characteristic function with parameters."""

    def count(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> int:
        """Count the poles in a region, with multiplicity, and prove the number.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            Ranges of the real part (1/s) and of the imaginary part (rad/s); None is an open end.
        edge : {"error", "inside", "outside"}
            What becomes of poles on the edge, as in `QuasiPolynomial.count`.

        Returns
        -------
        int

        Raises
        ------
        ContourError
            If a pole lies on the edge, or closer to it than the arithmetic can tell.
        ValueError
            If the region holds infinitely many poles, or as in `DelaySystem.characteristic`.

        Notes
        -----
        Of a `TransferFunction`, a root of the denominator at which the numerator is zero as well is
        no pole: see `poles`.

        A `DelaySystem` is split into blocks of states that depend on one another. For each, the
        matrix is factorised at points along the contour, so close to one another that bounds on its
        change and on all rounding prove how far the argument of the determinant turns between them.
        Only with an E that cannot be inverted is the determinant expanded for open sides.

        Examples
        --------
        >>> import numpy as np
        >>> import deadtime as dtm
        >>> dtm.DelaySystem({1.0: -np.eye(12)}).count(re=(-3, 1), im=(0, 20))
        36
        """
        return self._ask(lambda h: h.count(re, im, edge=edge))

    def poles(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> RootSet:
        """Locate every pole in a region, each in a disc proved to hold it.

        Parameters
        ----------
        re, im, edge
            As in `count`.

        Returns
        -------
        RootSet

        Raises
        ------
        ContourError, ValueError
            As in `count`.
        CountMismatchError
            If the arithmetic does not suffice to locate all poles that were counted.

        Notes
        -----
        The poles of a `DelaySystem` are all its modes. Of a `TransferFunction`, the attribute
        ``hidden`` has the roots of the denominator that are no poles: the numerator has a zero
        there of at least the same multiplicity, to the rounding of its coefficients and delays. One
        of lower multiplicity lowers that of the pole.

        Examples
        --------
        >>> import deadtime as dtm
        >>> T = dtm.feedback(2.0 / dtm.s * dtm.delay(0.36))
        >>> [complex(round(p.real, 4), round(p.imag, 4)) for p in T.poles(re=(-5, 0), im=(0, 10))]
        [(-1.5154+3.1005j)]
        """
        return self._ask(lambda h: h.roots(re, im, edge=edge))

    def certify(self, re: OpenRange | None = None, im: OpenRange | None = None) -> Certificate:
        """Count the poles in a region and write the proof down.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `count`.

        Returns
        -------
        Certificate

        Raises
        ------
        ContourError, ValueError
            As in `count`; ValueError also where the determinant cannot be expanded without
            rounding.

        Notes
        -----
        Of a `TransferFunction`, all roots of the denominator are counted.
        """
        return self._exactly().certify(re, im)

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost poles and prove that nothing else lies that far right.

        Parameters
        ----------
        n : int, default 1
            How many, not counting those with a negative imaginary part, which are listed as well.

        Returns
        -------
        RootSet
            As in `QuasiPolynomial.rightmost`.

        Raises
        ------
        ValueError, CountMismatchError
            As in `QuasiPolynomial.rightmost`.

        Notes
        -----
        Of a `DelaySystem`, guesses of the rightmost poles are eigenvalues of a linearisation of the
        characteristic matrix; Newton's method for a bordered matrix encloses each in a disc, and
        the matrix is factorised along one vertical line to count the poles right of it, as in
        `count`. Only where this proves nothing is the plane searched.
        """
        return self._ask(lambda h: h.rightmost(n))

    def spectral_abscissa(self, strong: bool = True) -> float:
        """Give the largest real part of a pole in 1/s, or `chain_abscissa` if that is larger.

        Parameters
        ----------
        strong : bool, default True
            Let the delays vary by arbitrarily little, as in `QuasiPolynomial.chain_abscissa`.

        Returns
        -------
        float
            -inf for a `TransferFunction` with no pole left, hidden roots apart.

        Raises
        ------
        ValueError
            As in `rightmost`; for ``strong=False`` also where only an expanded determinant could
            tell, and there is none.
        """
        return self._ask(lambda h: h.spectral_abscissa(strong))

    def chain_abscissa(self, strong: bool = True) -> float:
        """Give the real part that the chains of poles of a neutral system can come to, in 1/s.

        Parameters
        ----------
        strong : bool, default True
            As in `spectral_abscissa`.

        Returns
        -------
        float
            -inf for a system without delayed derivatives.

        Raises
        ------
        ValueError
            As in `spectral_abscissa`.
        """
        return self._ask(lambda h: h.chain_abscissa(strong))

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every pole is proved to lie left of the imaginary axis.

        Parameters
        ----------
        strong : bool, default True
            As in `QuasiPolynomial.is_stable`.

        Returns
        -------
        bool

        Raises
        ------
        ValueError
            As in `spectral_abscissa`.

        Notes
        -----
        A `DelaySystem` is asked about all its modes. A `TransferFunction` is asked about its poles,
        from input to output: a mode of `TransferFunction.hidden_modes` does not show there, and an
        unstable one must not be a state of what is built. Where the chains are left of the axis
        for exact delays only, they count: with ``strong=False`` the answer may be False.
        """
        return self._ask(lambda h: h.is_stable(strong))

    def crossings(
        self, ranges: Mapping[str, Range], *, at: Mapping[str, SupportsFloat] | None = None
    ) -> Crossings:
        """Every crossing of the imaginary axis as one number varies: `deadtime.crossings` of this.

        Parameters
        ----------
        ranges : mapping of str to (low, high)
            The one number that varies. Of a `TransferFunction`, taken as a loop gain, ``gain`` is a
            factor on it and ``delay`` a further delay in s. Of a `DelaySystem`, ``delay`` is the
            least delay of its states in s, to which the others keep their ratio.
        at : mapping of str to float, optional
            Values of the other numbers.

        Returns
        -------
        Crossings

        Raises
        ------
        ValueError, TypeError
            As in `deadtime.crossings`.

        Examples
        --------
        >>> import deadtime as dtm
        >>> found = (1.0 / dtm.s * dtm.delay(0.36)).crossings({"gain": (0.1, 10.0)})
        >>> found.values.round(4), found.direction
        (array([4.3633]), array([2], dtype=int32))
        """
        return crossings(self, ranges, at=at)
