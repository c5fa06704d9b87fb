"""The entries of the gallery from `problems.toml`, which says how they are written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deadtime.roots import ParametricQuasiPolynomial, QuasiPolynomial, delay, parameters, s


def entries() -> dict[str, dict[str, Any]]:
    """The fields of each problem, by key, in alphabetical order."""
    import tomllib  # where the problems are first used

    text = Path(__file__).with_name("problems.toml").read_text(encoding="utf-8")
    return {key: _fields(entry) for key, entry in sorted(tomllib.loads(text).items())}


def _fields(entry: dict[str, Any]) -> dict[str, Any]:
    fields = {"rightmost": None} | entry
    re, im = fields["region"]
    fields["region"] = tuple(re), tuple(im)
    if fields["rightmost"] is not None:
        real, imag = fields["rightmost"]
        fields["rightmost"] = complex(real, imag)
    if "terms" in fields:
        family = _family(fields.pop("terms"), fields["values"])
        fields |= {"family": family, "h": family.at(**fields["values"])}
    else:
        fields["h"] = QuasiPolynomial(fields.pop("coefficients"), fields.pop("delays"))
    return fields


def _family(terms: list[dict[str, Any]], values: Mapping[str, float]) -> ParametricQuasiPolynomial:
    known = dict(zip(values, parameters(" ".join(values)), strict=True))
    # A sum of nothing in which the names have their order.
    total: Any = 0.0 * sum(known.values(), start=0.0 * s)
    for term in terms:
        powers = dict(term)
        lag = powers.pop("delay", 0.0)
        product: Any = powers.pop("factor", 1.0) * s ** powers.pop("s", 0)
        for name, exponent in powers.items():
            product = product * known[name] ** exponent
        total = total + product * delay(known[lag] if isinstance(lag, str) else lag)
    assert isinstance(total, ParametricQuasiPolynomial)  # for the type checker
    return total
