"""The characteristic function of a continuous loop with some of its numbers as parameters."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from deadtime.roots import Parameter, ParametricQuasiPolynomial

__all__ = ["family_of_loop", "numbers_of"]


def family_of_loop(
    characteristic: Callable[[Mapping[str, Any]], Any],
    parameters: Mapping[str, float | None],
    names: Collection[str],
) -> ParametricQuasiPolynomial:
    """Return `characteristic` with the parameters `names`; the others keep their values."""
    values = numbers_of(parameters, names)
    values |= {name: Parameter(name) for name in names}
    family = characteristic(values)
    # Stability need not depend on every number of the loop.
    idle = tuple(name for name in names if name not in family.names)
    return ParametricQuasiPolynomial._of((*family.names, *idle), family._terms)


def numbers_of(parameters: Mapping[str, float | None], names: Collection[str]) -> dict[str, Any]:
    """Return the numbers of a loop that stability depends on; `names` must be among them."""
    values: dict[str, Any] = {**parameters}
    values.pop("limit", None)
    unknown = [name for name in names if name not in values and name != "delay"]
    if unknown:
        raise ValueError(
            f"ranges for {', '.join(unknown)}: stability depends on no such number of this loop, "
            f"but on {', '.join(dict.fromkeys([*values, 'delay']))}"
        )
    if "delay" not in values and "delay" not in names:
        raise ValueError(
            "the delay of this loop is None: give it a range, or set it with "
            "loop.replace(delay=...)"
        )
    return values
