"""Determinants of matrices of quasi-polynomials, expanded where this keeps their roots accurate.

The expansion is exact: floats are dyadic rationals, so that coefficients are integers over a power
of two, and delays are fractions. Each coefficient and delay is rounded once, at the end.

An exact expansion alone does not give accurate roots: where its terms are large compared with the
sensitivity of det M to the entries of M, rounding the terms moves the roots more than rounding the
entries does. To first order, rounding the coefficients changes the determinant by at most
u sum |terms|, and relative changes of u of the entries by u sum_ij |M_ij| |cofactor_ij|. The ratio
of the two is computed, and an expansion with a large ratio is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime.roots._quasipolynomial import QuasiPolynomial

#: The coefficients of a quasi-polynomial by power of s and delay.
Entry: TypeAlias = Mapping[tuple[int, float], float]
#: The same without rounding: integer coefficients by power of s and exact delay.
_Exact: TypeAlias = dict[tuple[int, Fraction], int]

# Upper limits on the states and the terms of an expansion, whose work grows like n 2^n times the
# terms.
LARGEST = 10
_MOST_TERMS = 1000

# Upper limit on the effect of rounding the coefficients, in units of that of rounding the entries:
# a larger one expands more systems and loses digits of their roots.
_MOST_GROWTH = 1e4

# Number of frequencies on the imaginary axis, where stability is decided, at which the cancellation
# of terms is computed, and of those among them with the largest cancellation, at which the effect
# of rounding is computed. More find a worse frequency and take longer.
_CANDIDATES = 4001
_SAMPLES = 64

# Ends of the range of these frequencies, relative to the smallest and the largest one at which two
# terms are equal in size.
_LOWER, _UPPER = 0.01, 100.0


class NotExpandedError(ValueError):
    """The determinant exists, but its rounded coefficients would not give accurate roots."""


def expanded(entries: Sequence[Sequence[Entry]], bordered: bool = False) -> QuasiPolynomial:
    """Determinant of a matrix of quasi-polynomials; NotExpandedError if it would be inaccurate.

    With `bordered` the last row and column belong to an output and an input, and the determinant
    may be zero.
    """
    return expanded_and_exact(entries, bordered)[0]


def expanded_and_exact(
    entries: Sequence[Sequence[Entry]], bordered: bool = False
) -> tuple[QuasiPolynomial, bool]:
    """The same, and whether no coefficient and no delay had to be rounded."""
    size = len(entries)
    states = size - int(bordered)
    if states > LARGEST:
        raise NotExpandedError(
            f"the determinant of {states} states is not expanded, because rounding its "
            f"coefficients would change its roots too much. At most {LARGEST} states are "
            "expanded. For any number of states, use poles(), rightmost(), is_stable() or "
            "frequency_response()"
        )
    # One power of two makes integers of all entries.
    shift = max(
        (Fraction(v).denominator for row in entries for e in row for v in e.values()), default=1
    )
    whole = [
        [{(k, Fraction(t)): int(Fraction(v) * shift) for (k, t), v in e.items()} for e in row]
        for row in entries
    ]
    exact = _determinant(whole)
    if not exact:
        if bordered:
            return QuasiPolynomial([[0.0]], [0.0]), True
        raise ValueError(
            "the determinant of the characteristic matrix is zero for every s, so the "
            "equations do not determine the state. Look for a row of E, N and A that is zero "
            "or occurs twice"
        )
    h = _rounded(exact, shift**size)
    terms = {
        (k, Fraction(tau)): Fraction(value) * shift**size
        for tau, row in zip(h.delays.tolist(), h.coefficients.tolist(), strict=True)
        for k, value in enumerate(row)
        if value
    }
    growth = _growth(entries, h)
    if growth > _MOST_GROWTH:
        raise NotExpandedError(
            f"expanding the determinant of these {states} states could move its roots "
            f"{growth:.1e} times as far as rounding the entries does. At most "
            f"{_MOST_GROWTH:.0e} times is allowed. Scale time or the states so that all entries "
            "have similar sizes. Or use poles(), rightmost() and frequency_response(), which "
            "do not need the expansion"
        )
    return h, terms == exact


def _determinant(rows: Sequence[Sequence[_Exact]]) -> _Exact:
    """Laplace expansion along the rows; the minors of the first k rows are stored by columns."""
    minors: dict[int, _Exact] = {0: {(0, Fraction(0)): 1}}
    for row in rows:
        following: dict[int, _Exact] = {}
        for columns, minor in minors.items():
            for j, entry in enumerate(row):
                if not entry or columns >> j & 1:
                    continue
                sign = -1 if (columns >> j).bit_count() & 1 else 1
                target = following.setdefault(columns | 1 << j, {})
                for (k, t), a in minor.items():
                    for (m, u), b in entry.items():
                        key = (k + m, t + u)
                        target[key] = target.get(key, 0) + sign * a * b
                if len(target) > _MOST_TERMS:
                    raise NotExpandedError(
                        f"the determinant has more than {_MOST_TERMS} terms, so it is not "
                        "expanded. Use poles(), rightmost() and frequency_response(), which "
                        "do not need the expansion"
                    )
        minors = following
    full = minors.get((1 << len(rows)) - 1, {})
    return {key: value for key, value in full.items() if value}


def _rounded(exact: _Exact, scale: int) -> QuasiPolynomial:
    """Divide coefficients by `scale` and round them and the delays to floats, each once."""
    delays = sorted({float(t) for _, t in exact})
    degree = max(k for k, _ in exact)
    sums: dict[tuple[int, float], int] = {}
    for (k, t), value in exact.items():
        sums[k, float(t)] = sums.get((k, float(t)), 0) + value
    coefficients = np.zeros((len(delays), degree + 1))
    for (k, tau), value in sums.items():
        try:
            coefficients[delays.index(tau), k] = float(Fraction(value, scale))
        except OverflowError as error:
            raise NotExpandedError(
                "a coefficient of the determinant is beyond 1e308: use another unit of "
                "time, or scale the equations"
            ) from error
    return QuasiPolynomial(coefficients, delays)


def _growth(entries: Sequence[Sequence[Entry]], h: QuasiPolynomial) -> float:
    """Largest ratio of the effect on h of rounding the coefficients to that of the entries.

    Since n |det| <= sum |M_ij| |cofactor_ij|, the ratio is large only where |h| is small compared
    with the sum of its terms. It is computed where this quotient is smallest, from a hundredth of
    the smallest to a hundred times the largest frequency at which two terms of h are equal in size.
    """
    size = np.abs(h.coefficients).sum(axis=0)
    used = np.flatnonzero(size)
    slopes = [
        (size[a] / size[b]) ** (1.0 / (b - a)) for i, a in enumerate(used) for b in used[i + 1 :]
    ]
    if not slopes:
        slopes = [1.0]
    omega = np.geomspace(_LOWER * min(slopes), _UPPER * max(slopes), _CANDIDATES)
    with np.errstate(all="ignore"):
        cancelled = np.abs(h(1j * omega)) / np.polyval(size[::-1], omega)
    omega = omega[np.argsort(cancelled)[:_SAMPLES]]
    n = len(entries)
    values = np.zeros((_SAMPLES, n, n), dtype=np.complex128)
    moduli = np.zeros((_SAMPLES, n, n))
    for i, row in enumerate(entries):
        for j, entry in enumerate(row):
            for (k, t), v in entry.items():
                values[:, i, j] += v * (1j * omega) ** k * np.exp(-1j * omega * t)
                moduli[:, i, j] += abs(v) * omega**k
    with np.errstate(all="ignore"):
        terms = np.polyval(size[::-1], omega)
        response = (moduli * _cofactors(values)).sum(axis=(1, 2))
        ratios = terms / response
    known = ratios[np.isfinite(ratios)]
    return float(known.max()) if known.size else np.inf


def _cofactors(matrices: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Moduli of the cofactors of a stack of matrices.

    Each is computed as a determinant: the entries of the inverse have errors in relation to the
    largest one, which is too inaccurate where the entries have different units.
    """
    n = matrices.shape[-1]
    moduli = np.empty(matrices.shape)
    for i in range(n):
        rows = np.delete(matrices, i, axis=-2)
        for j in range(n):
            moduli[..., i, j] = np.abs(np.linalg.det(np.delete(rows, j, axis=-1)))
    return moduli
