"""Frequencies at which a ratio n/d of quasi-polynomials has the modulus one, and where it ends."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from deadtime.roots._frequency import (
    DifferenceOfSquares,
    powers_of_s,
    without_powers,
    zeros_between,
)
from deadtime.roots._quasipolynomial import QuasiPolynomial

__all__ = ["end_of_gain", "end_or_corner", "gain_crossovers", "span"]

Vector = NDArray[np.float64]

# A neutral loop whose gain has no proved end above or below one is searched this many times beyond
# its highest corner.
_BEYOND_CORNERS = 100.0


def gain_crossovers(n: QuasiPolynomial, d: QuasiPolynomial) -> tuple[Vector, float]:
    """All frequencies above zero with |n| = |d|, and up to where that is all."""
    k = min(powers_of_s(n), powers_of_s(d)) if n.coefficients.any() else 0
    n, d = without_powers(n, k), without_powers(d, k)
    top, proved = end_of_gain(n, d, 1.0), True
    if top is None:
        top = end_of_gain(d, n, 1.0)
    if top is None:
        top, proved = _BEYOND_CORNERS * _highest_corner(n, d), False
    found = zeros_between(DifferenceOfSquares(d, n), 0.0, top)
    return found, math.inf if proved else top


def span(n: QuasiPolynomial, d: QuasiPolynomial) -> float:
    return float(max(n.delays[-1], d.delays[-1]) - min(n.delays[0], d.delays[0]))


def end_of_gain(
    n: QuasiPolynomial, d: QuasiPolynomial, level: float, shift: int = 0
) -> float | None:
    """A frequency beyond which |s^shift n| < level |d| is certain, None if that is not.

    |d| is at least the modulus of its leading term less those of all others, |n| at most the sum
    of its own; the difference, as a polynomial in omega, has one change of sign (Descartes) and
    its zero is below Fujiwara's bound.
    """
    width = max(n.degree + max(shift, 0), d.degree + max(-shift, 0)) + 1
    less = np.zeros(width)
    up, down = max(shift, 0), max(-shift, 0)
    less[up : up + n.degree + 1] += np.abs(n.coefficients).sum(axis=0)
    less[down : down + d.degree + 1] += level * np.abs(d.coefficients).sum(axis=0)
    lead = float(np.abs(d.coefficients[:, -1]).max())
    top = down + d.degree
    less[top] -= level * lead
    if less[top + 1 :].any() or less[top] >= level * lead:
        return None
    rest = less[:top] / (level * lead - less[top])
    powers = top - np.arange(top)
    with np.errstate(divide="ignore"):
        return float(2.0 * np.exp(np.max(np.log(rest) / powers, initial=-np.inf)))


def end_or_corner(n: QuasiPolynomial, d: QuasiPolynomial, shift: int, level: float) -> float:
    """`end_of_gain`, or a frequency far beyond all corners where there is none."""
    end = end_of_gain(n, d, level, shift)
    return _BEYOND_CORNERS * _highest_corner(n, d) if end is None else end


def _highest_corner(n: QuasiPolynomial, d: QuasiPolynomial) -> float:
    """Largest of the frequencies at which terms of n or d, or turns of their delays, change."""
    corners = [1e-300]
    for h in (n, d):
        size = np.abs(h.coefficients).sum(axis=0)
        lead = np.abs(h.coefficients[:, -1]).max()
        for k in range(h.degree):
            if size[k] > 0.0:
                corners.append(float((size[k] / lead) ** (1.0 / (h.degree - k))))
        corners += [2.0 * np.pi / float(gap) for gap in np.diff(h.delays)]
    gap = abs(float(n.delays[0] - d.delays[0]))
    return max([*corners, 2.0 * np.pi / gap] if gap > 0.0 else corners)
