"""Boundaries of a map: curves on which roots lie on the edge of stability, and chains of roots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays
from deadtime.roots import ParametricQuasiPolynomial
from deadtime.stability._native import MapBoundary


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
        The parameter that varies along the rows (or columns) in which the curve was found.

    Notes
    -----
    Each point is exact to rounding; between them the curve is what the map's other axis resolves.
    All arrays are read-only.
    """

    values: dict[str, Array]
    omega: Array
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
    axes: dict[str, Array],
    decay: float,
    damping: tuple[float, float] | None,
) -> tuple[Boundary, ...]:
    """Curves on which members of `family` have roots on the edge, longest first."""
    found = family._family.boundaries(axes, decay=decay, damping=damping)
    if found is None:
        raise ValueError(
            "all members of the family have a root at 0, and the family is not affine in "
            f"{' nor '.join(axes)}. Cancel the factor s to see the crossings of the other roots"
        )
    return boundaries_along(found, axes)


def boundaries_along(
    found: Sequence[MapBoundary], axes: Mapping[str, Array]
) -> tuple[Boundary, ...]:
    """Curves with the values of both parameters, longest first."""
    return tuple(
        Boundary(
            {
                name: curve.gain if name == curve.along else points[curve.row]
                for name, points in axes.items()
            },
            curve.omega,
            curve.crossing,
            curve.along,
        )
        for curve in sorted(found, key=lambda curve: -len(curve.gain))
    )
