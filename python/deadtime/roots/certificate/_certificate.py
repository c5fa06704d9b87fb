"""Proofs of root counts that can be stored, and checked independently."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from deadtime._base.notebook import Pictured
from deadtime.roots.certificate._check import check
from deadtime.roots.certificate._form import check_form
from deadtime.roots.certificate._parts import Proof
from deadtime.roots.certificate._stored import Stored

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Certificate(Proof, Stored, Pictured):
    """The proved number of roots in a region, with everything needed to check the proof.

    Made by `QuasiPolynomial.certify`. It contains the function, the region, the number and the
    proof.

    Attributes
    ----------
    coefficients : tuple of tuple of float
        Row j holds the ascending powers of s that belong to ``delays[j]``.
    delays : tuple of float
        In s.
    region : tuple of (float, float)
        Ranges of the real and the imaginary part; infinite ends are open.
    count : int
        Roots in the region, with multiplicity.
    scale, zeros : int
        The values in the proof are those of 2^scale h(s) / s^zeros: a common factor s^zeros of the
        coefficients gives exact roots at 0.
    beyond : tuple of (int, float) or None
        Row and radius, if the range of the imaginary part is open: in the strip of the region,
        where ``abs(s)`` is at least the radius, the leading term of the row exceeds the sum of the
        moduli of all others.
    closed : tuple of (float, float)
        The region with its open sides replaced by bounds beyond which there is no root: by
        `beyond`, or because the first (last) row exceeds the others far to the right (left).
        Reflected in the real axis if it extends farther below it than above.
    contours : tuple of Contour
        Paths around the closed region: one around the part symmetric about the real axis, of which
        only the upper half is stored, and one around the part above it.
    real : tuple of Segment or Monotone
        The real axis in parts, if it is the edge of the region: real roots then belong to the
        region.

    See Also
    --------
    QuasiPolynomial.certify

    Examples
    --------
    >>> from deadtime import delay, s
    >>> from deadtime.roots import Certificate
    >>> proof = (s + 2.0 * delay(0.36)).certify(re=(0, None))
    >>> proof
    <Certificate: 0 roots in re=(0, inf), im=(-inf, inf), proved on 3 segments>
    >>> proof.verify()
    0
    >>> Certificate.from_json(proof.to_json()) == proof
    True
    """

    _FORMAT = "deadtime certificate"
    _NOUN = "certificate"

    def __repr__(self) -> str:
        (a, b), (c, d) = self.region
        pieces = sum(len(contour.segments) for contour in self.contours) + len(self.real)
        return (
            f"<Certificate: {self.count} roots in re=({a:g}, {b:g}), im=({c:g}, {d:g}), "
            f"proved on {pieces} segments>"
        )

    def _check_form(self) -> None:
        check_form(self)

    def verify(self) -> int:
        """Check every claim independently of the code that made it.

        The checker is plain Python: polynomials are evaluated in exact integers, exponentials and
        angles are enclosed in fixed point to 120 binary digits below the value, inequalities are
        decided between fractions. It shares no code with the native part, whose bounds it confirms
        or refutes. It takes some tenths of a millisecond per segment, and a few milliseconds very
        close to a root of high multiplicity.

        Returns
        -------
        int
            The count.

        Raises
        ------
        CertificateError
            If a claim is false (the first false one is named), or needs more digits to check than
            any claim made by `QuasiPolynomial.certify`.

        Notes
        -----
        Along a segment the function stays in a disc that does not contain 0, so its argument
        changes by less than pi from one middle to the next; the sum of these changes around the
        region is 2 pi times the number of roots (argument principle).

        Examples
        --------
        >>> import dataclasses
        >>> from deadtime import delay, s
        >>> proof = (s + 5.0 * delay(0.36)).certify(re=(0, None))
        >>> proof.verify()
        2
        >>> dataclasses.replace(proof, count=0).verify()
        Traceback (most recent call last):
            ...
        deadtime._base.errors.CertificateError: the certificate is false: it proves 2 roots, but ...
        """
        return check(self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the contour in its segments, coloured by the argument of h; needs matplotlib.

        The colours pass through their full cycle once for every root inside.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; default is a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from deadtime._base.drawing import shown_axes
        from deadtime.roots.certificate._plots import plot_certificate

        axes = shown_axes(ax)
        plot_certificate(axes, self)
        return axes
