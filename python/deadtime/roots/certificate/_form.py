"""The form of a certificate: the types of its parts, and limits that bound the time of the check.

A certificate may come from an untrusted source. The checks here take time in proportion to its
length. Whether its claims are true is checked in `_check`, which refuses numbers with more digits
than a true certificate needs.
"""

from __future__ import annotations

import reprlib
from typing import Any, Final

from deadtime.roots.certificate._parts import Contour, Monotone, Proof, Segment

# Upper limit on the scale: coefficients are doubles, between 2^-1074 and 2^1024, so that no larger
# power of two is needed.
_LARGEST_SCALE: Final = 1 << 12

# One path around the part that is symmetric about the real axis, and one around the part above it.
_MOST_CONTOURS: Final = 2

_SEGMENT: Final = {
    "start": complex,
    "end": complex,
    "middle": complex,
    "reference": int,
    "value": complex,
    "error": float,
    "slope": float,
}
_MONOTONE: Final = {
    "start": float,
    "end": float,
    "middle": float,
    "reference": int,
    "slope": float,
    "error": float,
    "bend": float,
}
_WORDS: Final = {
    int: "a whole number",
    float: "a real number",
    complex: "a complex number",
    bool: "True or False",
    tuple: "a tuple",
}


def check_form(certificate: Proof) -> None:
    """Check types and bounds of all parts.

    Raises
    ------
    ValueError
        If a part is not valid; the message names the first one.
    """
    for number, row in enumerate(_parts("coefficients", certificate.coefficients)):
        for k, c in enumerate(_parts(f"coefficients[{number}]", row)):
            _is(f"coefficients[{number}][{k}]", c, float)
    for number, tau in enumerate(_parts("delays", certificate.delays)):
        _is(f"delays[{number}]", tau, float)
    _box("region", certificate.region)
    _box("closed", certificate.closed)
    for name in ("count", "scale", "zeros"):
        _is(name, getattr(certificate, name), int)
    if certificate.count < 0 or certificate.zeros < 0:
        raise ValueError("a number of roots is negative: count and zeros are 0 or more")
    if abs(certificate.scale) > _LARGEST_SCALE:
        raise ValueError(
            f"scale={reprlib.repr(certificate.scale)}: coefficients are doubles, which 2^scale "
            f"brings to about 1 for a scale between {-_LARGEST_SCALE} and {_LARGEST_SCALE}"
        )
    if certificate.beyond is not None:
        row, radius = _parts("beyond", certificate.beyond, 2)
        _is("beyond[0]", row, int)
        _is("beyond[1]", radius, float)
    contours = _parts("contours", certificate.contours)
    if len(contours) > _MOST_CONTOURS:
        raise ValueError(f"{len(contours)} contours: a region has at most {_MOST_CONTOURS}")
    for number, contour in enumerate(contours):
        name = f"contours[{number}]"
        if not isinstance(contour, Contour):
            raise ValueError(f"{name} is {reprlib.repr(contour)}, not a Contour")
        _box(name, (contour.re, contour.im))
        _is(f"{name}.symmetric", contour.symmetric, bool)
        _is(f"{name}.count", contour.count, int)
        for k, segment in enumerate(_parts(f"{name}.segments", contour.segments)):
            _part(f"{name}.segments[{k}]", segment, (Segment,))
    for number, part in enumerate(_parts("real", certificate.real)):
        _part(f"real[{number}]", part, (Segment, Monotone))


def _part(name: str, part: Any, kinds: tuple[type, ...]) -> None:
    """Check one segment of a path or part of the real axis."""
    if not isinstance(part, kinds):
        expected = " or ".join(kind.__name__ for kind in kinds)
        raise ValueError(f"{name} is {reprlib.repr(part)}, not a {expected}")
    for field, kind in (_MONOTONE if isinstance(part, Monotone) else _SEGMENT).items():
        _is(f"{name}.{field}", getattr(part, field), kind)


def _box(name: str, value: Any) -> None:
    """Check the ranges of the real and the imaginary part."""
    for which, ends in zip(("re", "im"), _parts(name, value, 2), strict=True):
        for end in _parts(f"{name}.{which}", ends, 2):
            _is(f"an end of {name}.{which}", end, float)


def _parts(name: str, value: Any, number: int | None = None) -> tuple[Any, ...]:
    _is(name, value, tuple)
    parts: tuple[Any, ...] = value
    if number is not None and len(parts) != number:
        raise ValueError(f"{name} has {len(parts)} parts, not {number}")
    return parts


def _is(name: str, value: Any, kind: type) -> None:
    """Refuse a value of another type, and NaN."""
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise ValueError(f"{name} is {reprlib.repr(value)}, not {_WORDS[kind]}")
    if kind in (float, complex) and value != value:
        raise ValueError(f"{name} is {value}, not {_WORDS[kind]}")
