"""The form of a certificate: the types of its parts, and limits that bound the time of the check.

A certificate may come from an untrusted source. Whether its claims are true is checked in `_check`,
which refuses numbers with more digits than a true certificate needs.
"""

from __future__ import annotations

import reprlib
from typing import Final

from deadtime.roots.certificate._parts import Proof
from deadtime.roots.certificate._stored import check_types

# Upper limit on the scale: coefficients are doubles, between 2^-1074 and 2^1024, so that no larger
# power of two is needed.
_LARGEST_SCALE: Final = 1 << 12

# One path around the part that is symmetric about the real axis, and one around the part above it.
_MOST_CONTOURS: Final = 2


def check_form(certificate: Proof) -> None:
    """Check types and bounds of all parts.

    Raises
    ------
    ValueError
        If a part is not valid; the message names the first one.
    """
    check_types(certificate)
    if certificate.count < 0 or certificate.zeros < 0:
        raise ValueError("a number of roots is negative, but count and zeros must be 0 or more")
    if abs(certificate.scale) > _LARGEST_SCALE:
        raise ValueError(
            f"scale={reprlib.repr(certificate.scale)}: the coefficients times 2^scale should be "
            f"about 1, which needs a scale between {-_LARGEST_SCALE} and {_LARGEST_SCALE}"
        )
    contours = len(certificate.contours)
    if contours > _MOST_CONTOURS:
        raise ValueError(
            f"there are {contours} contours, but a region has at most {_MOST_CONTOURS}"
        )
