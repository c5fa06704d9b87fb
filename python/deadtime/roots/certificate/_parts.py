"""What a certificate consists of: segments, parts of the real axis, contours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

__all__ = ["Contour", "Monotone", "Proof", "Segment"]

Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight line on which the function has no root.

    With g(s) = 2^scale h(s) s^-zeros exp(s tau), tau the delay number `reference`, g stays within
    ``error + slope * r`` of `value` along the line, r the distance of its ends from `middle`: a
    disc that does not hold 0.

    Attributes
    ----------
    start, end, middle : complex
        Ends of the line, and the point where g was evaluated.
    reference : int
        Index of the delay tau.
    value : complex
        g(middle), but for `error`.
    error : float
        Bound on the error of `value`.
    slope : float
        Bound on the modulus of g' in the disc about the middle that reaches to both ends.
    """

    start: complex
    end: complex
    middle: complex
    reference: int
    value: complex
    error: float
    slope: float


@dataclass(frozen=True, slots=True)
class Monotone:
    """A part of the real axis where g' has no zero: the signs of g at its ends tell the roots.

    Attributes
    ----------
    start, end, middle : float
        Ends, and the point where g' was evaluated.
    reference : int
        Index of the delay, as in a segment.
    slope : float
        g'(middle), but for `error`.
    error : float
        Bound on the error of `slope`.
    bend : float
        Bound on the modulus of g'' in the disc about the middle that reaches to both ends.
    """

    start: float
    end: float
    middle: float
    reference: int
    slope: float
    error: float
    bend: float


@dataclass(frozen=True, slots=True)
class Contour:
    """The path around a rectangle, anticlockwise.

    Attributes
    ----------
    re, im : tuple of (float, float)
        Its ranges.
    symmetric : bool
        Is it the upper half of a rectangle symmetric about the real axis? The path then leaves
        out the axis.
    count : int
        Roots inside; of a symmetric rectangle in both halves together.
    segments : tuple of segments
        In order, each beginning where the one before ends.
    """

    re: tuple[float, float]
    im: tuple[float, float]
    symmetric: bool
    count: int
    segments: tuple[Segment, ...]


@dataclass(frozen=True)
class Proof:
    """The claims of a `Certificate`, which says what each field is."""

    coefficients: tuple[tuple[float, ...], ...]
    delays: tuple[float, ...]
    region: tuple[Range, Range]
    count: int
    scale: int
    zeros: int
    beyond: tuple[int, float] | None
    closed: tuple[Range, Range]
    contours: tuple[Contour, ...]
    real: tuple[Segment | Monotone, ...]
