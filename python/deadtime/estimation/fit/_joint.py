"""Several recordings of the same vehicle, fitted by one set of numbers.

Numbers of the vehicle are common, the output at the start is each recording's own. Recordings
differ in how well the model explains them. Where the misfit is white, it is noise, and each counts
by the inverse of its variance, which maximum likelihood estimates along (iterated until it
rests). Where it is not, it is what the model lacks, which grows with the motion: then each
counts by the inverse of how far it was moved.
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

#: Rounds of weighing recordings by their misfit, at most, and the change at which they rest.
ROUNDS, AT_REST = 20, 1e-6

#: A misfit below this share of the largest one is rounding: it must not outweigh the others.
LEAST_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class JointModel:
    """The models of several recordings as one.

    Attributes
    ----------
    parts : tuple of Model
        One a recording; the same names are asked of each.
    weights : tuple of float
        Factor on the misfit of each.
    """

    parts: tuple[Model, ...]
    weights: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what is asked for."""
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
        """How far the recordings were moved at most."""
        return max(part.size for part in self.parts)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Samples of each recording."""
        return tuple(size for part in self.parts for size in part.sizes)

    @cached_property
    def _places(self) -> list[Array]:
        """Where the parameters of each recording stand among all."""
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
        """Lower bounds: the highest of the recordings' own."""
        ends = [part.low for part in self.parts]
        return self._joined(ends, np.max([end[: len(self.names)] for end in ends], axis=0))

    @cached_property
    def high(self) -> Array:
        """Upper bounds: the lowest of the recordings' own."""
        ends = [part.high for part in self.parts]
        return self._joined(ends, np.min([end[: len(self.names)] for end in ends], axis=0))

    @cached_property
    def scale(self) -> Array:
        """Sizes of the parameters."""
        ends = [part.scale for part in self.parts]
        return self._joined(ends, ends[0][: len(self.names)])

    def misfit(self, point: Array) -> Array:
        """Weighted misfits, one recording after the other."""
        return np.concatenate(
            [
                weight * part.misfit(point[place])
                for part, weight, place in zip(self.parts, self.weights, self._places, strict=True)
            ]
        )

    def jacobian(self, point: Array) -> Array:
        """Derivatives of the weighted misfits."""
        rows = []
        for part, weight, place in zip(self.parts, self.weights, self._places, strict=True):
            block = np.zeros((sum(part.sizes), point.size))
            block[:, place] = weight * part.jacobian(point[place])
            rows.append(block)
        return np.concatenate(rows)

    def starts(self) -> list[Array]:
        """Starts of every recording, the others' own parameters at their best first ones."""
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
        """Root mean square of the misfit of each recording, unweighted."""
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
    """Weigh recordings by their misfit until that rests."""
    for _ in range(ROUNDS):
        scatter = model.scatter(found)
        scatter = np.maximum(scatter, LEAST_SHARE * scatter.max())
        if not scatter.max() > 0.0:
            break
        weights = scatter.min() / scatter
        resting = np.max(np.abs(weights - model.weights)) <= AT_REST
        model = replace(model, weights=tuple(weights.tolist()))
        found = minimise(model, found.point)
        if resting:
            break
    return model, found
