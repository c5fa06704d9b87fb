"""Crossings of a delay that enters as several multiples of one.

    h(s) = sum_{k=0}^{N} P_k(s) z^k,  z = e^{-s u T},

has a root j omega for some T only where the polynomial in z has a root on the unit circle, and
then it shares that root with its reciprocal sum conj(P_k) z^(N-k): their resultant vanishes, which
is the determinant of the Schur-Cohn matrix (Schur 1917, Cohn 1922)

    C_ij = sum_{m<=min(i,j)} (conj(P_{i-m}) P_{j-m} - P_{N-i+m} conj(P_{N-j+m})),  0 <= i, j < N.

It is Hermitian, so that the determinant is a real function of omega, for which `zeros_between`
misses no zero up to a frequency that no unstable root exceeds. Zeros that belong to a pair of roots
z, 1/conj(z) off the circle are sorted out, the others refined with T by Newton's iteration for h.

As T grows the pair at j omega goes to the right where Re(P'/(s S)) > 0, with P' = sum P_k' z^k and
S = sum k P_k z^k, whatever of its delays T is (Olgac and Sipahi 2002).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TypeAlias

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from deadtime.roots._frequency import RealFunction, without_common_power, zeros_between
from deadtime.roots._quasipolynomial import QuasiPolynomial

__all__ = ["crossings_of_multiples"]

_Floats: TypeAlias = NDArray[np.float64]
_Complex: TypeAlias = NDArray[np.complex128]

#: A function of omega: polynomials by the delay of the exponential they go with.
_Waves: TypeAlias = dict[float, _Complex]

#: Largest multiple: the determinant has the order of it.
_MOST_MULTIPLES = 5

#: Largest denominator of the ratio of two multiples, and how exactly they have one.
_MOST_PARTS = 60
_ROUNDING = 1e-9

#: Modulus of a root, less one, up to which it may lie on the circle, and steps that put it there.
_ON_CIRCLE = 1e-2
_NEWTON = 30

#: How far Newton's iteration may move a frequency that is known, as a part of it.
_MOVE = 1e-3


def crossings_of_multiples(
    parts: Sequence[QuasiPolynomial], slopes: Sequence[float], name: str
) -> tuple[_Floats, _Floats, _Floats, NDArray[np.int32]]:
    """Frequencies at which roots cross, a delay for each, the period of its delays, direction.

    Parameters
    ----------
    parts : sequence of QuasiPolynomial
        The terms that go with each multiple of the delay, without their exponential.
    slopes : sequence of float
        The multiples, increasing from zero.
    name : str
        Name of the delay.

    Raises
    ------
    ValueError
        If the multiples are no whole multiples of one number, or of too many; if there is no end to
        the frequencies.
    """
    unit, multiples = _common(slopes, name)
    order = multiples[-1]
    by_multiple = dict(zip(multiples, parts, strict=True))
    waves = [_on_axis(by_multiple[k]) if k in by_multiple else {} for k in range(order + 1)]
    rows = {late: 1j * row for late, row in _determinant(_schur_cohn(waves)).items()}
    for late, row in rows.items():
        if late == 0.0:
            row.real[:] = 0.0
    function = RealFunction(without_common_power(rows))
    found: list[tuple[float, complex]] = []
    for omega in zeros_between(function, 0.0, _highest(parts, name)).tolist():
        for z in _roots_near_circle(by_multiple, omega, order):
            place = _refined(by_multiple, omega, z)
            if place is not None and not any(_same(place, other) for other in found):
                found.append(place)
    omegas = np.array([omega for omega, _ in found])
    turn = np.mod([-np.angle(z) for _, z in found], 2.0 * np.pi)
    direction = [_direction(by_multiple, omega, z) for omega, z in found]
    scale = unit * omegas
    return omegas, turn / scale, 2.0 * np.pi / scale, np.array(direction, dtype=np.int32)


def _common(slopes: Sequence[float], name: str) -> tuple[float, list[int]]:
    """The largest number of which all slopes are whole multiples, and the multiples."""
    first = slopes[1]
    ratios = [Fraction(slope / first).limit_denominator(_MOST_PARTS) for slope in slopes]
    exact = all(
        abs(float(ratio) * first - slope) <= _ROUNDING * slope
        for ratio, slope in zip(ratios, slopes, strict=True)
    )
    parts = math.lcm(*(ratio.denominator for ratio in ratios))
    multiples = [int(ratio * parts) for ratio in ratios]
    if not exact or multiples[-1] > _MOST_MULTIPLES:
        shown = ", ".join(f"{slope:g} {name}" for slope in slopes[1:])
        raise ValueError(
            f"{name} enters as several delays ({shown}): its crossings are known where these are "
            f"whole multiples of one, up to {_MOST_MULTIPLES} of it; a map over {name} and a "
            "second parameter shows its counts"
        )
    return first / parts, multiples


def _on_axis(h: QuasiPolynomial) -> _Waves:
    """h(j omega) by delay, ascending in omega."""
    turns = np.resize([1.0, 1j, -1.0, -1j], h.degree + 1)
    return {float(tau): row * turns for tau, row in zip(h.delays, h.coefficients, strict=True)}


def _conjugate(a: _Waves) -> _Waves:
    return {-late: np.conj(row) for late, row in a.items()}


def _sum(a: _Waves, b: _Waves, sign: float = 1.0) -> _Waves:
    total = dict(a)
    for late, row in b.items():
        total[late] = np.asarray(
            polynomial.polyadd(total.get(late, np.zeros(1)), sign * row), np.complex128
        )
    return total


def _product(a: _Waves, b: _Waves) -> _Waves:
    total: _Waves = {}
    for late, row in a.items():
        for later, other in b.items():
            together = {round(late + later, 12): np.asarray(np.convolve(row, other), np.complex128)}
            total = _sum(total, together)
    return total


def _schur_cohn(p: Sequence[_Waves]) -> list[list[_Waves]]:
    order = len(p) - 1
    bar = [_conjugate(part) for part in p]
    matrix: list[list[_Waves]] = [[{} for _ in range(order)] for _ in range(order)]
    for i in range(order):
        for j in range(order):
            for m in range(min(i, j) + 1):
                matrix[i][j] = _sum(matrix[i][j], _product(bar[i - m], p[j - m]))
                back = _product(p[order - i + m], bar[order - j + m])
                matrix[i][j] = _sum(matrix[i][j], back, -1.0)
    return matrix


def _determinant(matrix: Sequence[Sequence[_Waves]]) -> _Waves:
    """By the first row; the orders are small."""
    if len(matrix) == 1:
        return matrix[0][0]
    total: _Waves = {}
    for j, entry in enumerate(matrix[0]):
        minor = [[row[k] for k in range(len(row)) if k != j] for row in matrix[1:]]
        total = _sum(total, _product(entry, _determinant(minor)), -1.0 if j % 2 else 1.0)
    return total


def _highest(parts: Sequence[QuasiPolynomial], name: str) -> float:
    """A radius that no root with Re s >= 0 exceeds (Fujiwara's bound for moduli)."""
    degree = max(part.degree for part in parts)
    sizes = np.zeros(degree + 1)
    for part in parts:
        sizes[: part.degree + 1] += np.abs(part.coefficients).sum(axis=0)
    lead = abs(float(parts[0].coefficients[0, -1])) if parts[0].degree == degree else 0.0
    excess = 2.0 * lead - sizes[-1]
    if excess <= 0.0:
        raise ValueError(
            f"the terms with {name} outweigh the leading one at high frequencies: there is no end "
            "to the frequencies at which roots may cross"
        )
    below = np.arange(degree)
    ratios = (sizes[:-1] / excess) ** (1.0 / (degree - below))
    return float(2.0 * ratios.max(initial=0.0))


def _roots_near_circle(
    parts: dict[int, QuasiPolynomial], omega: float, order: int
) -> list[complex]:
    values = np.zeros(order + 1, dtype=np.complex128)
    for k, part in parts.items():
        values[order - k] = part(1j * omega)
    roots = np.roots(values)
    return [complex(z) for z in roots[np.abs(np.abs(roots) - 1.0) < _ON_CIRCLE]]


def _refined(
    parts: dict[int, QuasiPolynomial], omega: float, z: complex
) -> tuple[float, complex] | None:
    """The frequency and the point of the circle next to these at which h vanishes."""
    place, turn = omega, float(np.angle(z))
    for _ in range(_NEWTON):
        value, slope, by_turn, size = _values(parts, place, complex(np.exp(1j * turn)))
        by_omega, by_angle = 1j * slope, 1j * by_turn
        jacobian = np.array([[by_omega.real, by_angle.real], [by_omega.imag, by_angle.imag]])
        if abs(np.linalg.det(jacobian)) <= 1e-14 * abs(by_omega) * abs(by_angle):
            # Roots only touch the axis here, and the two numbers are known to what that leaves.
            close = abs(abs(z) - 1.0) <= 1e-6
            return (place, complex(np.exp(1j * turn))) if close else None
        change = np.linalg.solve(jacobian, [-value.real, -value.imag])
        place, turn = place + float(change[0]), turn + float(change[1])
        if abs(place - omega) > _MOVE * omega:
            return None
        if abs(change[0]) <= 1e-15 * place and abs(change[1]) <= 1e-15:
            break
    value, _, _, size = _values(parts, place, complex(np.exp(1j * turn)))
    return (place, complex(np.exp(1j * turn))) if abs(value) <= 1e-12 * size else None


def _values(
    parts: dict[int, QuasiPolynomial], omega: float, z: complex
) -> tuple[complex, complex, complex, float]:
    """h, P', S and the sum of moduli in h, at s = j omega."""
    value, slope, by_turn, size = 0j, 0j, 0j, 0.0
    for k, part in parts.items():
        term, change = complex(part(1j * omega)), complex(part.derivative()(1j * omega))
        value, slope, by_turn = (
            value + term * z**k,
            slope + change * z**k,
            by_turn + k * term * z**k,
        )
        size += float((np.abs(part.coefficients) * omega ** np.arange(part.degree + 1)).sum())
    return value, slope, by_turn, size


def _same(one: tuple[float, complex], other: tuple[float, complex]) -> bool:
    return abs(one[0] - other[0]) <= 1e-9 * one[0] and abs(one[1] - other[1]) <= 1e-7


def _direction(parts: dict[int, QuasiPolynomial], omega: float, z: complex) -> int:
    _, slope, by_turn, _ = _values(parts, omega, z)
    below = 1j * omega * by_turn
    across = (slope * np.conj(below)).real
    if abs(across) <= 1e-8 * abs(slope) * abs(below):
        return 0
    return 2 if across > 0.0 else -2
