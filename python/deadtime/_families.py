"""The family of characteristic functions behind a loop or an expression with parameters."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, cast

from deadtime._loop import ControlLoop
from deadtime._parametric import Parameter, ParametricQuasiPolynomial

__all__ = ["family_of", "numbers_of"]


def family_of(
    system: ParametricQuasiPolynomial | ControlLoop, names: Collection[str]
) -> ParametricQuasiPolynomial:
    """Return the characteristic function with the parameters `names` and no others.

    The other named numbers of a loop keep their values; an expression must not have others. The
    limit of a loop plays no part.

    Raises
    ------
    ValueError
        If a name is unknown, another parameter has no value, or the loop is sampled.
    TypeError
        If `system` is something else.
    """
    if isinstance(system, ControlLoop):
        return _of_loop(system, names)
    if not isinstance(system, ParametricQuasiPolynomial):
        raise TypeError(
            f"family of type {type(system).__name__}: give a ControlLoop, or an expression with "
            "the parameters of dtm.parameters('...')"
        )
    unknown = [name for name in names if name not in system.names]
    if unknown:
        raise ValueError(
            f"ranges for {', '.join(unknown)}: no such parameter, there "
            + (f"is {', '.join(system.names)}" if system.names else "is none")
        )
    missing = [name for name in system.names if name not in names]
    if missing:
        raise ValueError(
            f"no value for {', '.join(missing)}: put a number in its place where the family is "
            "written, or give it a range or a value"
        )
    return system


def _of_loop(loop: ControlLoop, names: Collection[str]) -> ParametricQuasiPolynomial:
    if loop.is_sampled:
        raise ValueError(
            f"a loop with sample_time={loop.sample_time} has no characteristic function to prove "
            "anything of, its poles are eigenvalues: judge loop.continuous() for the loop without "
            "its hold, or look at single cells with dtm.stability_map"
        )
    values = numbers_of(loop, names)
    values |= {name: Parameter(name) for name in names}
    family = cast("ParametricQuasiPolynomial", loop._characteristic(values))
    # Stability need not depend on every number of the loop.
    idle = tuple(name for name in names if name not in family.names)
    return ParametricQuasiPolynomial._of((*family.names, *idle), family._terms)


def numbers_of(loop: ControlLoop, names: Collection[str]) -> dict[str, Any]:
    """Return the numbers of a loop that stability depends on; `names` must be among them."""
    values: dict[str, Any] = {**loop.parameters}
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
