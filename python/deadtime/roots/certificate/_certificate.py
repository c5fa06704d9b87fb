"""Proofs of root counts that can be stored, and checked independently."""

from __future__ import annotations

import dataclasses
import json
import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeVar, get_type_hints

from deadtime._base.notebook import Pictured
from deadtime.roots.certificate._check import check
from deadtime.roots.certificate._form import check_form
from deadtime.roots.certificate._parts import Contour, Monotone, Proof, Range, Segment

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_T = TypeVar("_T")

_FORMAT: Final = "deadtime certificate"


@dataclass(frozen=True)
class Certificate(Proof, Pictured):
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

    def __repr__(self) -> str:
        (a, b), (c, d) = self.region
        pieces = sum(len(contour.segments) for contour in self.contours) + len(self.real)
        return (
            f"<Certificate: {self.count} roots in re=({a:g}, {b:g}), im=({c:g}, {d:g}), "
            f"proved on {pieces} segments>"
        )

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
        deadtime._base.errors.CertificateError: the certificate is false: 2 roots are proved, not 0
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

    def to_json(self, indent: int | None = None) -> str:
        """Write the certificate as JSON, with numbers in hexadecimal so that none is rounded.

        Parameters
        ----------
        indent : int, optional
            As in `json.dumps`.

        Returns
        -------
        str
        """
        return json.dumps({"format": _FORMAT, **_plain(self)}, indent=indent)

    @classmethod
    def from_json(cls, text: str) -> Certificate:
        """Read what `to_json` wrote; only the form is checked, `verify` checks the claims.

        Parameters
        ----------
        text : str

        Returns
        -------
        Certificate

        Raises
        ------
        ValueError
            If the text is not a certificate, or contains numbers that no certificate has.
        """
        try:
            data = json.loads(text)
            if data.pop("format") != _FORMAT:
                raise KeyError("format")
            read = cls(
                coefficients=_each(lambda row: _each(_number, row), data.pop("coefficients")),
                delays=_each(_number, data.pop("delays")),
                region=_box(data.pop("region")),
                count=data.pop("count"),
                scale=data.pop("scale"),
                zeros=data.pop("zeros"),
                beyond=_bound(data.pop("beyond")),
                closed=_box(data.pop("closed")),
                contours=_each(_contour, data.pop("contours")),
                real=_each(_part, data.pop("real")),
            )
            check_form(read)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise ValueError(f"this is not the text of a certificate: {error}") from error
        except RecursionError:
            raise ValueError(
                "this is not the text of a certificate: brackets are nested deeper than in one"
            ) from None
        return read


def _plain(value: Any) -> Any:
    """Convert a value to types of JSON; floats and complex numbers become hexadecimal text."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = dataclasses.fields(value)
        return {field.name: _plain(getattr(value, field.name)) for field in fields}
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, complex):
        return [value.real.hex(), value.imag.hex()]
    return value.hex() if isinstance(value, float) else value


def _number(text: Any) -> float:
    if not isinstance(text, str):
        raise TypeError(f"{reprlib.repr(text)}: a number is written in hexadecimal")
    return float.fromhex(text)


def _each(read: Callable[[Any], _T], values: Any) -> tuple[_T, ...]:
    if not isinstance(values, list):
        raise TypeError(f"{reprlib.repr(values)} is not a list")
    return tuple(map(read, values))


def _pair(read: Callable[[Any], _T], values: Any) -> tuple[_T, _T]:
    first, second = _each(read, values)
    return first, second


def _complex(values: Any) -> complex:
    return complex(*_pair(_number, values))


def _range(values: Any) -> Range:
    return _pair(_number, values)


def _box(values: Any) -> tuple[Range, Range]:
    return _pair(_range, values)


def _bound(values: Any) -> tuple[int, float] | None:
    if values is None:
        return None
    row, radius = _pair(lambda value: value, values)
    return row, _number(radius)


_READERS: Final[dict[Any, Callable[[Any], Any]]] = {
    complex: _complex,
    float: _number,
    int: lambda value: value,
}


def _part(data: Any) -> Segment | Monotone:
    kind = Monotone if "bend" in data else Segment
    hints = get_type_hints(kind)
    fields: dict[str, Any] = {name: _READERS[hints[name]](x) for name, x in data.items()}
    return kind(**fields)


def _contour(data: Any) -> Contour:
    return Contour(
        _range(data["re"]),
        _range(data["im"]),
        data["symmetric"],
        data["count"],
        _each(_part, data["segments"]),  # type: ignore[arg-type]
    )
