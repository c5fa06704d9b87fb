"""What is asked about the roots of a characteristic function."""

from __future__ import annotations

import math
from typing import Any, Literal, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

import deadtime.roots._native as native
from deadtime._base.validation import OpenRange, open_interval, whole_number
from deadtime.roots._chains import Chain, chains_of
from deadtime.roots._root_set import RootSet, rightmost_set, root_set
from deadtime.roots._sensitivity import RootSensitivity
from deadtime.roots.certificate._certificate import Certificate
from deadtime.roots.certificate._proof import proved

#: What becomes of roots on the edge of a region.
Edge: TypeAlias = Literal["error", "inside", "outside"]


class Characteristic:
    """The questions a `QuasiPolynomial`, which derives from this, answers about its roots."""

    __slots__ = ()

    _native: native.QuasiPolynomial
    _coefficients: NDArray[np.float64]
    _delays: NDArray[np.float64]

    def count(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> int:
        """Count the roots in a region, with multiplicity, and prove the number.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            Ranges of the real part (1/s) and of the imaginary part (rad/s); None is an open end.
            A root on the real axis belongs to a region that has the axis as its edge.
        edge : {"error", "inside", "outside"}
            What becomes of roots on the edge, or closer to it than their discs can tell: they are
            refused, belong to the region, or do not.

        Returns
        -------
        int

        Raises
        ------
        ContourError
            If a root lies on the edge, or closer to it than two words of double precision can
            tell. Its ``on_edge`` has the places, its ``inside`` the number that is clear of the
            edge. The edge is never moved silently.
        ValueError
            If a range is not increasing, or the region holds infinitely many roots.

        Notes
        -----
        Argument principle: on every segment of the contour a bound on the second derivative and
        on the rounding error shows that the function keeps its half plane (Taylor's formula), so
        the change of its argument is the principal one. Exponentials, sines and angles are the
        package's own, with derived error bounds. `certify` gives the same number with its proof.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (s + delay(1.0)).count(re=(-12, 2), im=(0, 1000))
        159
        >>> (s + 5.0 * delay(0.36)).count(re=(0, None))
        2
        >>> (s**2 + 4).count(re=(0, 1), im=(0, 3), edge="inside")
        1
        """
        return self._native.count(open_interval("re", re), open_interval("im", im), edge)

    def certify(self, re: OpenRange | None = None, im: OpenRange | None = None) -> Certificate:
        """Count the roots in a region and write the proof down.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `count`.

        Returns
        -------
        Certificate
            Its ``count`` is that of `count`; its ``verify()`` proves it again with exact numbers
            and none of the code that made it.

        Raises
        ------
        ContourError, ValueError
            As in `count`.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> proof = (s + delay(1.0)).certify(re=(-12, 2), im=(0, 100))
        >>> proof.count, proof.verify()
        (16, 16)
        """
        proof = self._native.certify(open_interval("re", re), open_interval("im", im))
        return proved(self._coefficients.tolist(), self._delays.tolist(), proof)

    def roots(
        self, re: OpenRange | None = None, im: OpenRange | None = None, *, edge: Edge = "error"
    ) -> RootSet:
        """Locate every root in a region, each with a disc proved to hold it.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `count`.
        edge : {"error", "inside", "outside"}
            As in `count`.

        Returns
        -------
        RootSet
            Its multiplicities add up to the number counted.

        Raises
        ------
        ContourError, ValueError
            As in `count`.
        CountMismatchError
            If two words of double precision do not suffice to locate all roots that were counted.

        Notes
        -----
        The region is divided into cells with proved counts; Newton's iteration in each, in two
        words where double precision is lost; a disc about every limit by Rouché's theorem, or by
        Pellet's for several roots that two words do not tell apart.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> ((s + delay(1.0)) ** 2).roots(re=(-1, 1), im=(0, 5)).multiplicities
        array([2])
        """
        return root_set(self._native.roots(open_interval("re", re), open_interval("im", im), edge))

    def rightmost(self, n: int = 1) -> RootSet:
        """Locate the rightmost roots and prove that nothing else lies that far right.

        Parameters
        ----------
        n : int, default 1
            How many, not counting those with a negative imaginary part, which are listed as well.

        Returns
        -------
        RootSet
            More than `n` if the real parts of the next ones cannot be told apart. Fewer if there
            are no more, or no more right of the last line that could be counted, for a neutral
            equation mostly next to its chains of roots, which ``chain_abscissa`` of the set names.
            ``region`` is the half plane in which these are all.

        Raises
        ------
        ValueError
            If `n` is less than 1, the equation is advanced, or no root was found and what lies
            next to the chains could not be counted.
        CountMismatchError
            If double precision does not tell the roots apart.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> h = s + (2.0 + 0.7 * s) * delay(0.36)
        >>> [complex(round(root.real, 3), round(root.imag, 3)) for root in h.rightmost()]
        [(-0.926+7.713j), (-0.926-7.713j)]
        """
        n = whole_number("n", n)
        return rightmost_set(self._native.rightmost(n), n, self.chain_abscissa)

    def spectral_abscissa(self, strong: bool = True) -> float:
        """Give the largest real part of a root, or `chain_abscissa` if that is larger.

        For a neutral equation, roots closer to the chains than 1e-3 of one over the longest
        delay are not distinguished from them; ``rightmost().region`` shows how close the search
        came. Where it came no closer and found no root, there is an error and no number.

        Parameters
        ----------
        strong : bool, default True
            As in `chain_abscissa`.

        Returns
        -------
        float
            In 1/s; infinite for an advanced equation.

        Raises
        ------
        ValueError
            If roots between the chains and the last line that could be counted are possible and
            none was found further right.

        Examples
        --------
        Stable for delays of exactly 1 and 2, and unstable for arbitrarily close ones:

        >>> from deadtime import delay, s
        >>> h = s - 0.25 + (1/3 - 0.75 * s) * delay(1.0) + 0.5 * s * delay(2.0)
        >>> round(h.spectral_abscissa(), 4), round(h.spectral_abscissa(strong=False), 4)
        (0.1616, -0.1701)
        """
        if self._native.kind() == "advanced":
            return math.inf
        return self._native.spectral_abscissa(bool(strong))

    def chain_abscissa(self, strong: bool = True) -> float:
        r"""Give the real part that the chains of roots of a neutral equation can come to.

        The solution c of :math:`\sum_j |b_j| e^{-c d_j} = |a|` with a the coefficient of the
        highest power of s without delay, b_j those with the delays d_j [1]_: the supremum over
        arbitrarily small changes of the delays. Rationally independent delays bring the chains
        there as they are; with those that are whole multiples of a `base_delay`, and as long as
        they are so exactly, the chains may lie further left.

        Parameters
        ----------
        strong : bool, default True
            Let the delays vary by arbitrarily little. With False they are taken as exact where
            they have a base.

        Returns
        -------
        float
            In 1/s; -inf where there are no chains (polynomial, retarded), inf if advanced.

        References
        ----------
        .. [1] C. E. Avellar and J. K. Hale, "On the zeros of exponential polynomials", Journal of
           Mathematical Analysis and Applications 73 (1980).

        Examples
        --------
        >>> from deadtime import delay, s
        >>> round((s + (2.0 + 0.3 * s) * delay(0.36)).chain_abscissa(), 4)
        -3.3444
        >>> h = s - 0.75 * s * delay(1.0) + 0.5 * s * delay(2.0) + 1
        >>> round(h.chain_abscissa(), 4), round(h.chain_abscissa(strong=False), 4)
        (0.1616, -0.3466)
        """
        free = self._native.chain_abscissa()
        if strong:
            return free
        exact = self._native.exact_chain_abscissa()
        return free if exact is None else exact

    @property
    def base_delay(self) -> float | None:
        """Largest number of which all differences of delays are whole multiples, to rounding.

        In s; None for rationally independent delays, as far as ratios with denominators up to 64
        tell, and where there is only one delay.

        Examples
        --------
        >>> import deadtime as dtm
        >>> (1 + dtm.delay(0.5) + dtm.delay(0.75)).base_delay
        0.25
        >>> (1 + dtm.delay(1.0) + dtm.delay(2**0.5)).base_delay is None
        True
        """
        return self._native.base_delay()

    def chains(self) -> tuple[Chain, ...]:
        r"""Give the laws that the roots of large modulus follow.

        Returns
        -------
        tuple of Chain
            One for every sequence of roots in the upper half plane, from the least bend to the
            largest; none for a polynomial.

        Notes
        -----
        Each edge of the upper convex hull of the points (delay, degree of its row) makes chains
        with :math:`\mathrm{Re}\, s \approx c - \mu \ln|s|`, the slope of the edge being
        :math:`-\mu` [1]_. Asymptotic: nothing is proved about any single root.

        References
        ----------
        .. [1] R. Bellman and K. L. Cooke, Differential-Difference Equations, Academic Press
           (1963), chapter 12.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (chain,) = (s + 2.0 * delay(0.36)).chains()
        >>> chain.kind, round(chain.bend, 4), round(chain.spacing, 4)
        ('retarded', 2.7778, 17.4533)
        >>> [chain.kind for chain in (s + (2.0 + 0.3 * s) * delay(0.36)).chains()]
        ['neutral']
        """
        return chains_of(cast("Any", self))

    def is_stable(self, strong: bool = True) -> bool:
        """Tell whether every root is proved to lie left of the imaginary axis.

        Parameters
        ----------
        strong : bool, default True
            Ask for strong stability [1]_: also under arbitrarily small changes of the delays,
            which matters for neutral equations. With False, delays that are whole multiples of a
            common one (to rounding) are taken as exactly that.

        Returns
        -------
        bool
            False also where a root lies on the axis or too close to it to tell, and for an
            advanced equation.

        Raises
        ------
        ValueError
            For the zero function.

        References
        ----------
        .. [1] J. K. Hale and S. M. Verduyn Lunel, "Strong stabilization of neutral functional
           differential equations", IMA Journal of Mathematical Control and Information 19 (2002).

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (s + 4.0 * delay(0.36)).is_stable(), (s + 5.0 * delay(0.36)).is_stable()
        (True, False)
        """
        return self._native.is_stable(bool(strong))

    def root_sensitivity(self, root: complex) -> RootSensitivity:
        r"""Derivatives of a simple root by every coefficient and every delay.

        Parameters
        ----------
        root : complex
            A root in 1/s, as `roots` or `rightmost` list it; its last digits do not matter.

        Returns
        -------
        RootSensitivity
            ``coefficients``, shape (m, d+1), and ``delays``, shape (m,), arranged as those of the
            quasi-polynomial.

        Raises
        ------
        ValueError
            If the place given is no root, or the root is multiple or in a cluster that double
            precision does not tell apart: it has no derivative.

        Notes
        -----
        :math:`ds/dp = -(\partial h/\partial p) / h'(s)` for :math:`h(s; p) = 0`, the exponential
        of the dominating term cancelled beforehand so that nothing overflows.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> h = s + 4.0 * delay(0.36)
        >>> move = h.root_sensitivity(h.rightmost()[0])
        >>> bool(move.coefficients[1, 0].real > 0), bool(move.delays[1].real > 0)
        (True, True)
        """
        place = complex(root)
        rows, width = self._coefficients.shape
        found = self._native.sensitivity(
            place, np.repeat(self._delays, width).tolist(), list(range(width)) * rows
        )
        coefficients = found.coefficients.reshape(rows, width)
        # h depends on a delay through its row alone, d/dtau of which is -s times the row.
        delays = -found.root * (coefficients * self._coefficients).sum(axis=1)
        return RootSensitivity(found.root, coefficients, delays)
