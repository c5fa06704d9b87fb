"""Certificates made from the proofs of the native part."""

from __future__ import annotations

from typing import Any, TypeVar

import deadtime.roots._native as native
from deadtime.roots.certificate._certificate import Certificate
from deadtime.roots.certificate._parts import Contour, Monotone, Segment

_T = TypeVar("_T")


def proved(
    coefficients: list[list[float]], delays: list[float], proof: native.Certificate
) -> Certificate:
    """Make the certificate of a function from a proof of the native part."""
    return _copied(
        Certificate,
        proof,
        coefficients=tuple(map(tuple, coefficients)),
        delays=tuple(delays),
        contours=tuple(
            _copied(Contour, contour, segments=tuple(map(_copied_part, contour.segments)))
            for contour in proof.contours
        ),
        real=tuple(map(_copied_part, proof.real)),
    )


def _copied(kind: type[_T], native: Any, **made: Any) -> _T:
    """Make a dataclass from the attributes of an object, except for the fields in `made`."""
    names: tuple[str, ...] = kind.__match_args__  # type: ignore[attr-defined]
    return kind(**{name: made[name] if name in made else getattr(native, name) for name in names})


def _copied_part(part: native.Segment | native.Monotone) -> Segment | Monotone:
    if isinstance(part, native.Monotone):
        return _copied(Monotone, part)
    return _copied(Segment, part)
