"""The characteristic function of a system with chosen numbers left open as parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Protocol, SupportsFloat

from deadtime._base.validation import numbers_at
from deadtime.roots._parametric import ParametricQuasiPolynomial


class HasFamily(Protocol):
    """A system whose numbers can become parameters of its characteristic function."""

    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial: ...


def family_of(
    system: HasFamily, names: Collection[str], at: Mapping[str, SupportsFloat] | None = None
) -> ParametricQuasiPolynomial:
    """Return the characteristic function with the parameters `names` and no others.

    Other parameters take their values from `at`. Named numbers of a loop that are in neither keep
    the values they have; an expression must not have such parameters. The limit of a loop plays
    no part.

    Raises
    ------
    ValueError
        If a name is unknown, has a range and a value, or another parameter has no value, or if the
        loop is sampled.
    TypeError
        If `system` is something else.
    """
    made = getattr(system, "_family_of", None)
    if made is None:
        raise TypeError(
            f"family is of type {type(system).__name__}: give a ControlLoop, or an expression with "
            "parameters from dtm.parameters('...')"
        )
    values = numbers_at(at, names)
    family: ParametricQuasiPolynomial = made((*names, *values))
    return family._with(values) if values else family
