"""The parts of a certificate: segments, parts of the real axis, contours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight line on which the function has no root.

    Let g(s) = 2^scale h(s) s^-zeros exp(s tau), where tau is the delay with the index `reference`.
    Along the line g stays within ``error + slope * r`` of `value`, where r is the larger distance
    of the ends from `middle`. This disc does not contain 0.

    Attributes
    ----------
    start, end, middle : complex
        Ends of the line, and the point where g was evaluated.
    reference : int
        Index of the delay tau.
    value : complex
        g(middle), with an error of at most `error`.
    error : float
        Bound on the error of `value`.
    slope : float
        Bound on the modulus of g' in the disc of radius r about the middle.
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
    """A part of the real axis where g' has no zero, so that g has a root if its sign changes.

    Attributes
    ----------
    start, end, middle : float
        Ends, and the point where g' was evaluated.
    reference : int
        Index of the delay, as in a segment.
    slope : float
        g'(middle), with an error of at most `error`.
    error : float
        Bound on the error of `slope`.
    bend : float
        Bound on the modulus of g'' in the disc about the middle that contains both ends.
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
        Whether this is the upper half of a rectangle symmetric about the real axis; its path then
        does not include the axis.
    count : int
        Number of roots inside; for a symmetric rectangle, in both halves together.
    segments : tuple of segments
        In order, each from the end of the one before.
    """

    re: tuple[float, float]
    im: tuple[float, float]
    symmetric: bool
    count: int
    segments: tuple[Segment, ...]


@dataclass(frozen=True)
class Proof:
    """The claims of a `Certificate`, where the fields are described."""

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
