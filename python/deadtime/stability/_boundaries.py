"""What divides a map: curves on which roots lie on the edge of stability, and chains of roots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import ReadOnlyArrays, read_only
from deadtime.roots import ParametricQuasiPolynomial

__all__ = ["Boundary", "boundaries_of", "chains_of"]

_Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Boundary(ReadOnlyArrays):
    """One curve on which a root lies on the boundary of stability; see `StabilityMap.boundaries`.

    Attributes
    ----------
    values : dict of str to ndarray
        The two parameters at each point of the curve, shape (n,).
    omega : ndarray of float64, shape (n,)
        Imaginary part of the root there, rad/s, zero or positive.
    crossing : ndarray of int32, shape (n,)
        Roots that become unstable as the parameter `along` grows through the point, less those that
        become stable: 2 or -2 for a pair, 1 or -1 for a real root.
    along : str
        The parameter that varies along the rows of the map.

    Notes
    -----
    Each point is exact to rounding; between them the curve is what the map's other axis resolves.
    All arrays are read-only.
    """

    values: dict[str, _Floats]
    omega: _Floats
    crossing: NDArray[np.int32]
    along: str

    def __len__(self) -> int:
        return len(self.omega)

    def __repr__(self) -> str:
        ends = ", ".join(
            f"{name} {v.min():.6g} to {v.max():.6g}" for name, v in self.values.items()
        )
        return (
            f"<Boundary of {len(self)} points: {ends}, "
            f"omega {self.omega.min():.6g} to {self.omega.max():.6g} rad/s>"
        )


def boundaries_of(
    family: ParametricQuasiPolynomial,
    axes: dict[str, _Floats],
    decay: float,
    damping: tuple[float, float] | None = None,
    threads: int | None = None,
) -> tuple[Boundary, ...]:
    """Curves on which members of `family` have roots on the edge, longest first."""
    names = tuple(axes)
    found = family._family.boundaries(*_grid(family, axes), decay, damping, threads)
    if found is None:
        raise ValueError(
            f"the family is affine in neither {names[0]} nor {names[1]}, and a root of all its "
            "members stays at 0: cancel the factor s to see where the others cross"
        )
    along, curves = found
    across = axes[names[1 - along]]
    result = []
    for gains, rows, omega, crossing in sorted(curves, key=lambda curve: -len(curve[0])):
        pair = (gains, across[rows])
        values = dict(zip(names, pair if along == 0 else pair[::-1], strict=True))
        for array in (*values.values(), omega, crossing):
            read_only(array)
        result.append(Boundary(values, omega, crossing, names[along]))
    return tuple(result)


def chains_of(family: ParametricQuasiPolynomial, axes: dict[str, _Floats]) -> _Floats:
    """Abscissas of the chains of roots of the members of `family`, shape (n0, n1)."""
    found: _Floats = read_only(family._family.chains(*_grid(family, axes)))
    return found


def _grid(
    family: ParametricQuasiPolynomial, axes: dict[str, _Floats]
) -> tuple[list[float], tuple[int, int], _Floats, _Floats]:
    """Values, places and points of two parameters as the native core takes them."""
    one, two = axes
    places = (family.names.index(one), family.names.index(two))
    return [0.0] * len(family.names), places, axes[one], axes[two]
