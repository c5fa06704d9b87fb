"""Largest gains over frequency by ball arithmetic, which shares nothing with the kernel.

On a cell of frequencies with the middle m and the half width r, abs(G)^2 is at most

    g0(m) + abs(g1(m)) r + abs(g2(cell)) r^2

with the coefficients of its Taylor series, in balls of which the last one holds the whole cell.
Cells whose bound is below a value that is taken are dropped, the others halved.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from flint import acb, acb_series, arb, ctx

#: Bits of the balls, and terms of the series.
_BITS = 120
_TERMS = 3

#: Cells at first, and rounds of halving at most.
_CELLS = 200
_ROUNDS = 90


def largest_gain(
    gain: Callable[[acb_series], acb_series], low: float, high: float, tolerance: float
) -> float:
    """A gain that is taken between two frequencies, and that none exceeds by more than `tolerance`.

    `gain` is the transfer function of a series in s = j omega. Cells grow with the frequency.
    """
    bits, terms = ctx.prec, ctx.cap
    ctx.prec, ctx.cap = _BITS, _TERMS
    try:
        ratio = (high / low) ** (1.0 / _CELLS)
        edges = [low * ratio**k for k in range(_CELLS)] + [high]
        cells = list(pairwise(edges))
        best = arb(0)
        for _ in range(_ROUNDS):
            bounds = []
            for a, b in cells:
                middle = 0.5 * (a + b)
                r = arb(1.0000001 * max(b - middle, middle - a))
                here = _square(gain, arb(middle))
                around = _square(gain, arb(middle, float(r)))
                best = max(best, here[0].mid())
                bounds.append(here[0] + abs(here[1]) * r + abs(around[2]) * r * r)
            enough = best * (1 + 2 * arb(tolerance))
            cells = [
                half
                for (a, b), bound in zip(cells, bounds, strict=True)
                if not bound <= enough
                for half in ((a, 0.5 * (a + b)), (0.5 * (a + b), b))
            ]
            if not cells:
                return float(best.sqrt())
        raise AssertionError(f"{len(cells)} cells are left next to {cells[0]}")
    finally:
        ctx.prec, ctx.cap = bits, terms


def _square(gain: Callable[[acb_series], acb_series], omega: arb) -> list[arb]:
    """The series of abs(G)^2 in the frequency."""
    try:
        values = gain(acb_series([acb(0, omega), acb(0, 1)]))
    except ValueError:
        # A wide ball around the denominator holds zero.
        return [arb("inf")] * _TERMS
    coefficients = [values[k] for k in range(_TERMS)]
    return [
        sum((coefficients[i] * coefficients[k - i].conjugate() for i in range(k + 1)), acb(0)).real
        for k in range(_TERMS)
    ]
