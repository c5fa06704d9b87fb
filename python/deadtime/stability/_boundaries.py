"""Boundaries of a map: curves on which roots lie on the edge of stability, and chains of roots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import ReadOnlyArrays, read_only
from deadtime._deadtime import MapBoundary
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
    damping: tuple[float, float] | None,
) -> tuple[Boundary, ...]:
    """Curves on which members of `family` have roots on the edge, longest first."""
    found = family._family.boundaries(axes, decay=decay, damping=damping)
    if found is None:
        raise ValueError(
            f"the family is affine in neither {' nor '.join(axes)}, and a root of all its "
            "members stays at 0: cancel the factor s to see where the others cross"
        )
    return tuple(
        _boundary(curve, axes) for curve in sorted(found, key=lambda curve: -len(curve.gain))
    )


def _boundary(curve: MapBoundary, axes: dict[str, _Floats]) -> Boundary:
    values = {
        name: curve.gain if name == curve.along else points[curve.row]
        for name, points in axes.items()
    }
    return Boundary(values, curve.omega, curve.crossing, curve.along)


def chains_of(family: ParametricQuasiPolynomial, axes: dict[str, _Floats]) -> _Floats:
    """Abscissas of the chains of roots of the members of `family`, shape (n0, n1)."""
    found: _Floats = read_only(family._family.chains(axes))
    return found
