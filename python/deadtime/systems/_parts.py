"""Numerator and denominator of a transfer function, read from what was given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias, cast

from numpy.typing import ArrayLike, NDArray

from deadtime._base.validation import real_array
from deadtime.roots import QuasiPolynomial, is_number

Polynomial: TypeAlias = QuasiPolynomial | float | Sequence[float] | NDArray[Any]


def quasi_polynomial(name: str, given: Polynomial) -> QuasiPolynomial:
    """Give what was given as a quasi-polynomial."""
    if isinstance(given, QuasiPolynomial):
        return given
    if is_number(given):
        return QuasiPolynomial([[float(cast(float, given))]], [0.0])
    descending = real_array(name, cast(ArrayLike, given))
    if descending.ndim != 1 or descending.size == 0:
        raise ValueError(
            f"{name} of shape {descending.shape}: give a QuasiPolynomial, a number, or the "
            "coefficients in descending powers of s"
        )
    return QuasiPolynomial(descending[None, ::-1], [0.0])


def without_common_delay(
    n: QuasiPolynomial, d: QuasiPolynomial
) -> tuple[QuasiPolynomial, QuasiPolynomial]:
    """Cancel the smallest delay, unless rounding would change another one."""
    both = [h for h in (n, d) if h.coefficients.any()]
    smallest = float(min(h.delays[0] for h in both))
    times = [float(tau) for h in both for tau in h.delays]
    if smallest == 0.0 or any(math.fsum((t, -smallest, -(t - smallest))) for t in times):
        return n, d
    n, d = (
        QuasiPolynomial(h.coefficients, h.delays - smallest) if h.coefficients.any() else h
        for h in (n, d)
    )
    return n, d


def without_common_powers(
    one: QuasiPolynomial, other: QuasiPolynomial
) -> tuple[QuasiPolynomial, QuasiPolynomial]:
    """Divide both by the highest power of s that divides every row of both exactly."""
    k = min(one._native.powers_of_s(), other._native.powers_of_s())
    one, other = (QuasiPolynomial._wrap(h._native.without_powers(k)) for h in (one, other))
    return one, other
