"""Quasi-polynomials as text: as they are printed, and in LaTeX for notebooks."""

from __future__ import annotations

import re
from typing import TypeAlias

#: Name and power of each parameter, by name.
Powers: TypeAlias = tuple[tuple[str, int], ...]
#: Constant part, and name and slope of each parameter, by name.
Delay: TypeAlias = tuple[float, tuple[tuple[str, float], ...]]
#: Powers of the parameters, power of s, delay.
Monomial: TypeAlias = tuple[Powers, int, Delay]
Terms: TypeAlias = dict[Monomial, float]

NO_DELAY: Delay = (0.0, ())


def row_text(row: list[float], tau: float) -> str:
    """Write one polynomial and its delay down."""
    parts = []
    for power, c in enumerate(row):
        if c == 0.0:
            continue
        name = "" if power == 0 else "s" if power == 1 else f"s^{power}"
        if name and abs(c) == 1.0:
            parts.append(("-" if c < 0.0 else "") + name)
        else:
            parts.append(f"{c:.12g} {name}".rstrip())
    text = joined(parts) or "0"
    if tau == 0.0:
        return text
    factor = f"exp(-{tau:.12g} s)"
    if text in ("1", "-1"):
        return text[:-1] + factor
    return f"({text}) {factor}" if len(parts) > 1 else f"{text} {factor}"


def family_text(terms: Terms, names: tuple[str, ...]) -> str:
    """Write the terms down in the manner of `QuasiPolynomial`, gathered by delay."""
    by_delay: dict[Delay, list[tuple[Monomial, float]]] = {}
    for key, value in terms.items():
        by_delay.setdefault(key[2], []).append((key, value))
    summands = []
    for delay in sorted(by_delay, key=lambda d: (len(d[1]), d)):
        row = sorted(by_delay[delay], key=lambda item: _rank(item[0], names))
        inner = [_product(value, key[0], key[1]) for key, value in row]
        if delay == NO_DELAY:
            summands += inner
            continue
        factor = f"exp(-{_affine(delay)} s)"
        if len(inner) > 1:
            summands.append(f"({joined(inner)}) {factor}")
        else:
            summands.append(_factored(inner[0], factor))
    return joined(summands) if summands else "0"


def _rank(key: Monomial, names: tuple[str, ...]) -> tuple[float, ...]:
    """Order by the power of s, then high powers of the parameters first."""
    exponents = dict(key[0])
    return (key[1], *(-exponents.get(name, 0) for name in names))


def _affine(delay: Delay) -> str:
    constant, slopes = delay
    summands = [_product(slope, ((name, 1),), 0) for name, slope in slopes]
    if constant or not summands:
        summands.append(_number(constant))
    single = len(summands) == 1 and not summands[0].startswith("-")
    return summands[0] if single else f"({joined(summands)})"


def _product(coefficient: float, powers: Powers, power: int) -> str:
    factors = [*powers, ("s", power)] if power else list(powers)
    text = " ".join(name if n == 1 else f"{name}^{n}" for name, n in factors)
    return _factored(_number(coefficient), text) if text else _number(coefficient)


def _factored(left: str, right: str) -> str:
    """Write two factors, a leading 1 left out."""
    return left[:-1] + right if left in ("1", "-1") else f"{left} {right}"


def joined(summands: list[str]) -> str:
    return " + ".join(summands).replace("+ -", "- ")


def _number(value: float) -> str:
    return f"{value:.12g}"


def latex(text: str) -> str:
    """Turn printed quasi-polynomials into LaTeX."""
    text = re.sub(r"exp\(-(\([^()]*\)|[^()]*) s\)", r"@{-\1 s}", text)
    text = re.sub(r"(\d)e([+-])0*(\d+)", r"\1 # 10^\2\3", text)
    text = re.sub(r"\^([+-]?\d+)", lambda found: f"^{{{found[1].lstrip('+')}}}", text)
    text = re.sub(r"[A-Za-z_]\w+", lambda name: _upright(name[0]), text)
    text = text.replace("(", r"\left(").replace(")", r"\right)")
    return text.replace("@", "e^").replace("#", r"\cdot")


def _upright(name: str) -> str:
    """Write a name of several letters in one piece."""
    escaped = name.replace("_", r"\_")
    return rf"\mathrm{{{escaped}}}"
