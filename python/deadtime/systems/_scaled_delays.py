"""The characteristic function of a delay system whose delays grow in proportion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from deadtime.roots import ParametricQuasiPolynomial, QuasiPolynomial, delay, parameters, s


def scaled_family(h: QuasiPolynomial, smallest: float) -> ParametricQuasiPolynomial:
    """Return h with all delays as multiples of the least one, the parameter `delay`."""
    (own,) = parameters("delay")
    total: Any = 0.0 * own
    for tau, row in zip(h.delays.tolist(), h.coefficients.tolist(), strict=True):
        part = sum((c * s**power for power, c in enumerate(row) if c != 0.0), 0.0 * s)
        ratio = tau / smallest
        # Sums of delays carry their rounding.
        ratio = float(round(ratio)) if abs(ratio - round(ratio)) <= 1e-12 * ratio else ratio
        total = total + part * delay(ratio * own)
    found: ParametricQuasiPolynomial = total
    return found


def smallest_delay(delays: Iterable[float]) -> float:
    """The least delay of the states that is not zero."""
    late = [tau for tau in delays if tau > 0.0]
    if not late:
        raise ValueError(
            "the states of this system have no delay, so its roots do not depend on a delay"
        )
    return min(late)
