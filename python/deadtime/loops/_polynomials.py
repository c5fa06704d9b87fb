"""Polynomials in s whose coefficients, descending, are numbers, arrays of numbers or symbols."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from deadtime.roots import s

__all__ = ["Polynomial", "in_s", "multiplied", "scaled", "summed"]

Polynomial: TypeAlias = list[Any]


def multiplied(p: Polynomial, q: Polynomial) -> Polynomial:
    """Product of two polynomials."""
    out: Polynomial = [0.0] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            out[i + j] = out[i + j] + a * b
    return out


def summed(p: Polynomial, q: Polynomial) -> Polynomial:
    """Sum of two polynomials."""
    if len(p) < len(q):
        p, q = q, p
    head = len(p) - len(q)
    return p[:head] + [a + b for a, b in zip(p[head:], q, strict=True)]


def scaled(factor: Any, p: Polynomial) -> Polynomial:
    """A polynomial times a number or symbol."""
    return [factor * a for a in p]


def in_s(coefficients: Sequence[Any]) -> Any:
    """The quasi-polynomial, with symbols the family, of these coefficients."""
    total: Any = 0.0 * s
    for power, c in enumerate(reversed(coefficients)):
        if not (isinstance(c, float) and c == 0.0):
            total = total + c * s**power
    return total
