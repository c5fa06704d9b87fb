"""Quasi-polynomials on the imaginary axis: all zeros of a real function there.

With |f^(K)| <= B on the interval of half width r about m, a real f has by Taylor's formula

    no zero there           if |f(m)| > sum_{0<k<K} |f^(k)(m)| r^k / k! + B r^K / K!,
    one zero there at most  if |f'(m)| > sum_{1<k<K} |f^(k)(m)| r^(k-1) / (k-1)! + ...,

Intervals of which neither is known are halved. B comes from the moduli of the coefficients, so
nothing is passed over between the points of a grid; bounds on rounding are added to both tests.
What is left where rounding hides the sign is a point at which f touches zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import factorial

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from deadtime.roots._quasipolynomial import QuasiPolynomial

__all__ = [
    "DifferenceOfSquares",
    "OnAxis",
    "RealFunction",
    "powers_of_s",
    "ratio_rows",
    "without_common_power",
    "without_powers",
    "zeros_between",
]

Vector = NDArray[np.float64]

_EPS = float(np.finfo(np.float64).eps)

# Halvings before an interval that starts at zero is dropped, and intervals in hand before the
# function is taken to vanish on a whole range.
_HALVINGS = 400
_MOST = 400_000

# K for real functions: a zero of that order at omega = 0 still leaves few intervals next to it.
_ORDER = 6


def powers_of_s(h: QuasiPolynomial) -> int:
    """Return the highest k such that s^k divides every row of `h` exactly; 0 for zero."""
    used = np.flatnonzero(h.coefficients.any(axis=0))
    return int(used[0]) if used.size else 0


def without_powers(h: QuasiPolynomial, k: int) -> QuasiPolynomial:
    """Divide by s^k, which must divide `h`."""
    return h if k == 0 else QuasiPolynomial(h.coefficients[:, k:], h.delays)


class OnAxis:
    """Value and slope of h(j omega), and bounds on g = h e^(s centre) and its derivatives."""

    def __init__(self, h: QuasiPolynomial, centre: float) -> None:
        self._h, self._slope = h, h.derivative()
        away = np.abs(h.delays - centre)[:, None]
        size = np.abs(h.coefficients)
        first = polynomial.polyder(size, axis=1)
        second = polynomial.polyder(size, 2, axis=1)
        self._bounds = (
            size.sum(axis=0),
            _added(first.sum(axis=0), (away * size).sum(axis=0)),
            _added(
                second.sum(axis=0),
                _added(2.0 * (away * first).sum(axis=0), (away**2 * size).sum(axis=0)),
            ),
        )
        self._terms = 8.0 * (h.degree + len(h.delays) + 4.0)
        self._longest = float(h.delays[-1])

    def __call__(self, omega: Vector) -> NDArray[np.complex128]:
        """Value of h."""
        return self._h(1j * omega)

    def slope(self, omega: Vector) -> NDArray[np.complex128]:
        """Derivative of h(j omega) by omega."""
        return 1j * self._slope(1j * omega)

    def bounds(self, omega: Vector) -> tuple[Vector, Vector, Vector]:
        """Bounds on the moduli of g and its first two derivatives up to `omega`."""
        b0, b1, b2 = (np.asarray(polynomial.polyval(omega, b)) for b in self._bounds)
        return b0, b1, b2

    def rounding(self, omega: Vector) -> Vector:
        """Relative error of values, as parts of their bounds."""
        return np.asarray(_EPS * (self._terms + 4.0 * omega * self._longest))


def _added(a: Vector, b: Vector) -> Vector:
    return np.asarray(polynomial.polyadd(a, b))


class RealFunction:
    """Im of the sum over delta of C(omega) e^(-j omega delta), with rows as `ratio_rows` gives."""

    def __init__(self, rows: Mapping[float, NDArray[np.complex128]]) -> None:
        self._chain = [_Waves(rows)]
        for _ in range(_ORDER):
            self._chain.append(self._chain[-1].derivative())

    def value(self, omega: Vector) -> Vector:
        """The function."""
        return self._chain[0](omega)

    def slope(self, omega: Vector) -> Vector:
        """Its derivative."""
        return self._chain[1](omega)

    def noise(self, omega: Vector) -> tuple[Vector, Vector]:
        """Bounds on the rounding errors of both."""
        return self._chain[0].noise(omega), self._chain[1].noise(omega)

    def change(self, m: Vector, r: Vector, slope: Vector) -> tuple[Vector, Vector]:
        """How far function and slope can change within r of m, by Taylor's formula."""
        of_slope = self._chain[_ORDER].bound(m + r) * r ** (_ORDER - 1) / factorial(_ORDER - 1)
        of_value = of_slope * r / _ORDER + slope * r
        for k in range(2, _ORDER):
            f = self._chain[k]
            size = (np.abs(f(m)) + f.noise(m)) * r ** (k - 1) / factorial(k - 1)
            of_slope += size
            of_value += size * r / k
        return of_value, of_slope


class DifferenceOfSquares(RealFunction):
    """|d|^2 - |n|^2: value and slope from d and n themselves, which cancels less."""

    def __init__(self, d: QuasiPolynomial, n: QuasiPolynomial) -> None:
        # |d|^2 = Im(j d conj(d)).
        rows, other = ratio_rows(d, d, 1), ratio_rows(n, n, 1)
        for delta, row in other.items():
            rows[delta] = np.asarray(
                polynomial.polysub(rows.get(delta, np.zeros(1)), row), np.complex128
            )
        super().__init__(rows)
        self._d, self._n = OnAxis(d, 0.0), OnAxis(n, 0.0)

    def value(self, omega: Vector) -> Vector:
        return np.asarray(np.abs(self._d(omega)) ** 2 - np.abs(self._n(omega)) ** 2)

    def slope(self, omega: Vector) -> Vector:
        d, n = self._d, self._n
        half = np.conj(d(omega)) * d.slope(omega) - np.conj(n(omega)) * n.slope(omega)
        return np.asarray(2.0 * half.real)

    def noise(self, omega: Vector) -> tuple[Vector, Vector]:
        of_value, of_slope = np.zeros(omega.shape), np.zeros(omega.shape)
        for h in (self._d, self._n):
            error = h.rounding(omega)
            b0, b1, _ = h.bounds(omega)
            size, steep = np.abs(h(omega)), np.abs(h.slope(omega))
            of_value += 2.0 * error * b0 * (size + error * b0)
            of_slope += 2.0 * error * (b0 * steep + b1 * size + error * b0 * b1)
        return of_value, of_slope


class _Waves:
    """Im of the sum over delta of C(omega) e^(-j omega delta), C ascending in omega."""

    def __init__(self, rows: Mapping[float, NDArray[np.complex128]]) -> None:
        self._rows = dict(rows)
        size = max(len(row) for row in self._rows.values())
        total = np.zeros(size)
        for delta, row in self._rows.items():
            # Without a delay a real part has no imaginary one at any frequency.
            total[: len(row)] += np.abs(row if delta != 0.0 else row.imag)
        self._bound = total
        self._terms = 8.0 * (size + len(self._rows) + 4.0)
        self._longest = max(map(abs, self._rows))

    def __call__(self, omega: Vector) -> Vector:
        total = np.zeros(omega.shape)
        for delta, row in self._rows.items():
            across = polynomial.polyval(omega, row.imag)
            if delta == 0.0:
                total += across
            else:
                turned = omega * delta
                along = polynomial.polyval(omega, row.real)
                total += across * np.cos(turned) - along * np.sin(turned)
        return total

    def derivative(self) -> _Waves:
        """Derivative by omega."""
        return _Waves(
            {
                delta: np.asarray(
                    polynomial.polyadd(polynomial.polyder(row), -1j * delta * row), np.complex128
                )
                for delta, row in self._rows.items()
            }
        )

    def bound(self, omega: Vector) -> Vector:
        """Bound on the modulus up to `omega`."""
        return np.asarray(polynomial.polyval(omega, self._bound))

    def noise(self, omega: Vector) -> Vector:
        """Bound on the rounding error."""
        return np.asarray(_EPS * (self._terms + 4.0 * omega * self._longest) * self.bound(omega))


def ratio_rows(
    n: QuasiPolynomial, d: QuasiPolynomial, quarter_turns: int
) -> dict[float, NDArray[np.complex128]]:
    """Rows of j^quarter_turns n conj(d) on the axis by difference of delays, ascending in omega.

    Its imaginary part vanishes where j^quarter_turns n/d is real. What does not show in it is
    left out, real parts without delay, and coefficients of imaginary parts that are zero but for
    rounding.
    """
    turn = (1.0, 1j, -1.0, -1j)[quarter_turns % 4]
    rows: dict[float, NDArray[np.complex128]] = {}
    sizes: dict[float, Vector] = {}
    up = np.resize([1.0, 1j, -1.0, -1j], n.degree + 1)
    down = np.resize([1.0, -1j, -1.0, 1j], d.degree + 1)
    for a, tau in zip(n.coefficients, n.delays, strict=True):
        for b, sigma in zip(d.coefficients, d.delays, strict=True):
            delta = float(tau - sigma)
            product = np.asarray(turn * np.convolve(a * up, b * down), np.complex128)
            size = np.convolve(np.abs(a), np.abs(b))
            rows[delta] = product + rows[delta] if delta in rows else product
            sizes[delta] = size + sizes[delta] if delta in sizes else size
    for delta, row in rows.items():
        row.imag[np.abs(row.imag) <= 64.0 * _EPS * sizes[delta]] = 0.0
        if delta == 0.0:
            row.real[:] = 0.0
    return rows


def without_common_power(
    rows: Mapping[float, NDArray[np.complex128]],
) -> dict[float, NDArray[np.complex128]]:
    """Divide by the power of omega that is common to all rows: it has no sign for omega > 0."""
    used = [np.flatnonzero(row) for row in rows.values() if row.any()]
    common = min((int(places[0]) for places in used), default=0)
    return {delta: row[common:] for delta, row in rows.items()}


def zeros_between(f: RealFunction, low: float, high: float) -> Vector:
    """All zeros of `f` in (low, high], ascending; those at which it only touches zero as well.

    A zero at omega = 0 itself is left out.

    Raises
    ------
    ValueError
        If `f` vanishes, to rounding, on a whole range.
    """
    brackets: list[Vector] = [np.empty((0, 2))]
    touching: list[Vector] = []
    a, b = np.array([low]), np.array([high])
    for _ in range(_HALVINGS):
        if a.size == 0:
            break
        if a.size > _MOST:
            raise ValueError(
                f"between {a.min():.6g} and {b.max():.6g} rad/s there are too many crossings to "
                "list (the gain is one, or the phase a multiple of 180 degrees, on a whole range "
                "of frequencies, or the delay is very long for such frequencies)"
            )
        m, r = 0.5 * (a + b), 0.5 * (b - a)
        value, slope = np.abs(f.value(m)), np.abs(f.slope(m))
        noise, slope_noise = f.noise(m)
        change, slope_change = f.change(m, r, slope + slope_noise)
        none = value > change + noise
        single = ~none & (slope > slope_change + slope_noise)
        if single.any():
            pairs = np.column_stack([a[single], b[single]])
            at_a, at_b = np.sign(f.value(pairs[:, 0])), np.sign(f.value(pairs[:, 1]))
            brackets.append(pairs[(at_b == 0.0) | (at_a * at_b < 0.0)])
        rest = ~none & ~single
        hidden = rest & ((change <= noise) | (r <= 2.0 * _EPS * m))
        if hidden.any():
            touching.append(np.column_stack([a[hidden], b[hidden]]))
        rest &= ~hidden
        # What remains next to zero after so many halvings is the zero at omega = 0.
        a, m, b = a[rest], m[rest], b[rest]
        a, b = np.concatenate([a, m]), np.concatenate([m, b])
    low_ends, high_ends = np.vstack(brackets).T
    return np.sort(np.append(_refined(f, low_ends, high_ends), _touched(f, touching)))


def _refined(f: RealFunction, a: Vector, b: Vector) -> Vector:
    """The zero of every bracket by Newton's iteration, halving where that leaves the bracket."""
    a, b = a.copy(), b.copy()
    rising = np.sign(f.value(b)) - np.sign(f.value(a)) > 0.0
    x = 0.5 * (a + b)
    for _ in range(_HALVINGS):
        value = f.value(x)
        above = (value > 0.0) == rising
        a, b = np.where(above, a, x), np.where(above, x, b)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = x - value / f.slope(x)
        # A step smaller than the spacing of the numbers there stays where it is.
        inside = (newton >= a) & (newton <= b)
        following = np.where(value == 0.0, x, np.where(inside, newton, 0.5 * (a + b)))
        done = np.abs(following - x) <= 2.0 * _EPS * x
        x = following
        if done.all():
            break
    return x


def _touched(f: RealFunction, intervals: list[Vector]) -> list[float]:
    """One point for each connected set of intervals, but none for one that begins at zero."""
    if not intervals:
        return []
    ordered = np.vstack(intervals)
    ordered = ordered[np.argsort(ordered[:, 0])]
    first = np.append(True, ordered[1:, 0] > ordered[:-1, 1])
    points = []
    for group in np.split(ordered, np.flatnonzero(first)[1:]):
        if group[0, 0] > 0.0:
            middles = group.mean(axis=1)
            points.append(float(middles[np.argmin(np.abs(f.value(middles)))]))
    return points
