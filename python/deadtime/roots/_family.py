"""The characteristic function of a system with chosen numbers left open as parameters."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from deadtime.roots._parametric import ParametricQuasiPolynomial

__all__ = ["HasFamily", "family_of"]


class HasFamily(Protocol):
    """A system whose numbers can become parameters of its characteristic function."""

    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial: ...


def family_of(system: HasFamily, names: Collection[str]) -> ParametricQuasiPolynomial:
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
    made = getattr(system, "_family_of", None)
    if made is None:
        raise TypeError(
            f"family of type {type(system).__name__}: give a ControlLoop, or an expression with "
            "the parameters of dtm.parameters('...')"
        )
    family: ParametricQuasiPolynomial = made(names)
    return family
