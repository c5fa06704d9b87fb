"""Several recordings of the same vehicle, fitted by one set of parameters.

The parameters of the vehicle are common; each recording has its own initial output. The recordings
are weighted. Where residuals are white, they are noise, and the weight is the inverse of their
standard deviation, which is estimated too (iterated to convergence). Where they are not, the model
is incomplete and its error grows with the motion: the weight is then the inverse of the excitation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deadtime.estimation.fit._least_squares import Minimum, Model, minimise, solve
from deadtime.estimation.fit._residuals import whiteness_of

__all__ = ["JointModel", "solve_jointly"]

Array = NDArray[np.float64]

#: Most iterations of the weights, and the change at which they have converged.
ITERATIONS, CONVERGED = 20, 1e-6

#: Smallest residuals of a recording, as a share of the largest of any recording: below it is
#: rounding, which must not outweigh the other recordings.
LEAST_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class JointModel:
    """The models of several recordings as one.

    Attributes
    ----------
    parts : tuple of Model
        One for each recording; all have the same names.
    weights : tuple of float
        Factor on the residuals of each.
    """

    parts: tuple[Model, ...]
    weights: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the common parameters."""
        return self.parts[0].names

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of all parameters: the common ones, then those of each recording."""
        count = len(self.names)
        own = [
            f"{label} of recording {number}"
            for number, part in enumerate(self.parts, 1)
            for label in part.labels[count:]
        ]
        return (*self.names, *own)

    @property
    def size(self) -> float:
        """Largest excitation of the recordings."""
        return max(part.size for part in self.parts)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Samples of each recording."""
        return tuple(size for part in self.parts for size in part.sizes)

    @cached_property
    def _places(self) -> list[Array]:
        """Indices of the parameters of each recording among all parameters."""
        count, after, places = len(self.names), len(self.names), []
        for part in self.parts:
            own = len(part.labels) - count
            places.append(np.concatenate([np.arange(count), np.arange(after, after + own)]))
            after += own
        return places

    def _joined(self, ends: Sequence[Array], common: Array) -> Array:
        count = len(self.names)
        return np.concatenate([common, *(end[count:] for end in ends)])

    @cached_property
    def low(self) -> Array:
        """Lower bounds: the largest over the recordings."""
        ends = [part.low for part in self.parts]
        return self._joined(ends, np.max([end[: len(self.names)] for end in ends], axis=0))

    @cached_property
    def high(self) -> Array:
        """Upper bounds: the smallest over the recordings."""
        ends = [part.high for part in self.parts]
        return self._joined(ends, np.min([end[: len(self.names)] for end in ends], axis=0))

    @cached_property
    def scale(self) -> Array:
        """Scales of the parameters."""
        ends = [part.scale for part in self.parts]
        return self._joined(ends, ends[0][: len(self.names)])

    def misfit(self, point: Array) -> Array:
        """Weighted residuals, one recording after the other."""
        return np.concatenate(
            [
                weight * part.misfit(point[place])
                for part, weight, place in zip(self.parts, self.weights, self._places, strict=True)
            ]
        )

    def jacobian(self, point: Array) -> Array:
        """Derivatives of the weighted residuals."""
        rows = []
        for part, weight, place in zip(self.parts, self.weights, self._places, strict=True):
            block = np.zeros((sum(part.sizes), point.size))
            block[:, place] = weight * part.jacobian(point[place])
            rows.append(block)
        return np.concatenate(rows)

    def starts(self) -> list[Array]:
        """Starting points of every recording, completed by the best ones of the others."""
        starts = [part.starts() for part in self.parts]
        own = [points[0] for points in starts]
        count = len(self.names)
        candidates = [
            np.clip(self._joined(own, point[:count]), self.low, self.high)
            for points in starts
            for point in points[:3]
        ]
        return sorted(candidates, key=lambda point: float(np.sum(self.misfit(point) ** 2)))

    def scatter(self, minimum: Minimum) -> Array:
        """Root mean square of the unweighted residuals of each recording."""
        ends = np.cumsum(self.sizes)[:-1]
        pieces = np.split(minimum.misfit, ends)
        return np.array(
            [
                float(np.sqrt(np.mean(piece**2))) / weight
                for piece, weight in zip(pieces, self.weights, strict=True)
            ]
        )


def solve_jointly(parts: Sequence[Model]) -> tuple[Model, Minimum]:
    """Return the model of all recordings, its weights included, and its minimum."""
    if len(parts) == 1:
        return parts[0], solve(parts[0])
    sizes = np.array([part.size for part in parts])
    by_size = JointModel(tuple(parts), tuple((sizes.min() / sizes).tolist()))
    first = solve(by_size)
    model, found = _by_scatter(by_size, first)
    if whiteness_of(found.misfit, len(model.names), model.sizes).white:
        return model, found
    return by_size, first


def _by_scatter(model: JointModel, found: Minimum) -> tuple[JointModel, Minimum]:
    """Iterate weights and fit until the weights converge."""
    for _ in range(ITERATIONS):
        scatter = model.scatter(found)
        scatter = np.maximum(scatter, LEAST_SHARE * scatter.max())
        if not scatter.max() > 0.0:
            break
        weights = scatter.min() / scatter
        converged = np.max(np.abs(weights - model.weights)) <= CONVERGED
        model = replace(model, weights=tuple(weights.tolist()))
        found = minimise(model, found.point)
        if converged:
            break
    return model, found
