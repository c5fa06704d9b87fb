"""Values of ratios of quasi-polynomials, without overflow where the ratio has none.

Both are taken as h(s) = m e^x, x the real exponent of the largest exponential and of the highest
power of s; the exponents are subtracted before anything is raised to them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from deadtime.roots import QuasiPolynomial
from deadtime.roots._frequency import powers_of_s, without_powers

__all__ = ["first_term", "ratio"]

# Numerators and denominators between these are divided as they are, with less rounding.
_SMALL, _LARGE = 1e-140, 1e140


def ratio(
    n: QuasiPolynomial, d: QuasiPolynomial, points: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Divide n by d at one dimension of points: inf where only d is zero, NaN where both are."""
    with np.errstate(all="ignore"):
        above, below = n(points), d(points)
        values = above / below
        usual = (np.abs(above) > _SMALL) & (np.abs(above) < _LARGE)
        usual &= (np.abs(below) > _SMALL) & (np.abs(below) < _LARGE)
        odd = np.flatnonzero(~usual)
        if odd.size:
            values[odd] = _scaled_ratio(n, d, points[odd])
    return np.asarray(values)


def first_term(h: QuasiPolynomial) -> tuple[float, int]:
    """First term a s^p of the Taylor series at zero that is not zero to rounding."""
    p = powers_of_s(h)
    h = without_powers(h, p)
    step = 0
    while True:
        parts = h.coefficients[:, 0]
        value = math.fsum(parts)
        size = float(np.abs(h.coefficients).sum() * (1.0 + h.delays[-1]) ** min(step, 1))
        if abs(value) > 16.0 * np.finfo(float).eps * size or not h.coefficients.any():
            return value / math.factorial(step), p + step
        h, step = h.derivative(), step + 1


def _scaled_ratio(
    n: QuasiPolynomial, d: QuasiPolynomial, points: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """n/d from mantissas and exponents."""
    (above, up), (below, down) = _scaled(n, points), _scaled(d, points)
    # Neither quotient overflows: a part may be finite where the modulus is not.
    sizes = np.abs(above), np.abs(below)
    direction = (above / sizes[0]) / (below / sizes[1])
    exponent = up - down + np.log(sizes[0]) - np.log(sizes[1])
    values = np.empty_like(direction)
    for into, part in ((values.real, direction.real), (values.imag, direction.imag)):
        into[:] = np.where(
            part == 0.0, 0.0, np.sign(part) * np.exp(exponent + np.log(np.abs(part)))
        )
    # NumPy divides complex numbers by zero part by part.
    values[(below == 0.0) & (above != 0.0)] = np.inf
    values[(below == 0.0) & (above == 0.0)] = np.nan
    values[(below != 0.0) & (above == 0.0)] = 0.0
    return np.asarray(values)


def _scaled(
    h: QuasiPolynomial, points: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return m and x with h(s) = m e^x, where x is real."""
    far = np.abs(points) > 1.0
    safe = np.where(far, points, 1.0)
    near = np.where(far, 1.0 / safe, points)
    exponents = -np.outer(h.delays, points.real)
    largest = exponents.max(axis=0)
    total = np.zeros(points.shape, dtype=np.complex128)
    for row, tau, exponent in zip(h.coefficients, h.delays, exponents, strict=True):
        polynomial = np.where(far, np.polyval(row, near), np.polyval(row[::-1], near))
        turned = np.exp((exponent - largest) - 1j * tau * points.imag)
        total += polynomial * turned
    direction = (safe / np.abs(safe)) ** h.degree
    return total * direction, largest + h.degree * np.log(np.abs(safe))
