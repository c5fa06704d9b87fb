"""Least squares over named parameters: a minimum, and the minimum with one quantity held.

A model gives the misfit (simulated minus recorded output) of its recordings and its derivatives.
The search is SciPy's trust-region method from a few starting points, because the cost has several
local minima over the delay. With a quantity held, the other parameters are minimised over; delay +
lag is held by changing the delay opposite to the lag.

Several recordings of the same vehicle are fitted by one set of parameters.
The parameters of the vehicle are common; each recording has its own initial output. The recordings
are weighted. Where residuals are white, they are noise, and the weight is the inverse of their
standard deviation, which is estimated too (iterated to convergence). Where they are not, the model
is incomplete and its error grows with the motion: the weight is then the inverse of the excitation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation.data._checks import excited
from deadtime.estimation.fit._directions import Directions, all_directions
from deadtime.estimation.fit._residuals import whiteness_of
from deadtime.recordings import Recording

#: Starting points that are refined; the best minimum is taken.
REFINED = 3

#: Most evaluations of one search.
EVALUATIONS = 200

#: Relative change of cost or parameters at which a search ends: at rounding for a result; earlier
#: where minima are compared or only the cost is needed, which is flat there.
TO_ROUNDING, TO_COMPARE = 1e-14, 1e-6

#: Most iterations of the weights, and the change at which they have converged.
ITERATIONS, CONVERGED = 20, 1e-6

#: Smallest residuals of a recording, as a share of the largest of any recording: below it is
#: rounding, which must not outweigh the other recordings.
LEAST_SHARE = 1e-6


class Ends(NamedTuple):
    """Bounds and scale of a parameter."""

    low: float
    high: float
    scale: float


@dataclass(frozen=True, eq=False)
class Fitted:
    """One recording and its parameters: `names`, then the initial output if that is fitted too.

    Attributes
    ----------
    recording : Recording
        What is fitted.
    names : tuple of str
        Names of the parameters to be estimated.
    offset : float or None
        The output at the start where it is known.
    """

    recording: Recording
    names: tuple[str, ...]
    offset: float | None

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return (*self.names, *(["initial output"] if self.offset is None else []))

    def values(self, point: Array) -> dict[str, float]:
        """The parameters to be estimated, by name."""
        return dict(zip(self.names, point.tolist(), strict=False))

    def start_of(self, point: Array) -> float:
        """The output at the start."""
        return float(point[-1]) if self.offset is None else self.offset


class ModelOfOne(Fitted, ABC):
    """Misfit of one recording as a function of its parameters."""

    #: Factor on the residuals of each recording.
    weights = (1.0,)

    @abstractmethod
    def ends(self, label: str) -> Ends:
        """Bounds and scale of one of the parameters."""

    @abstractmethod
    def misfit(self, point: Array) -> Array:
        """Simulated minus recorded output, shape (n,)."""

    @abstractmethod
    def jacobian(self, point: Array) -> Array:
        """Derivatives of the misfit, shape (n, p)."""

    @abstractmethod
    def starts(self) -> list[Array]:
        """Starting points, the best first."""

    @cached_property
    def size(self) -> float:
        """Size of the excitation."""
        return excited(self.recording)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Samples of each recording, in the order of the misfit."""
        return (len(self.recording),)

    @cached_property
    def low(self) -> Array:
        """Lower bounds."""
        return np.array([self.ends(label).low for label in self.labels])

    @cached_property
    def high(self) -> Array:
        """Upper bounds."""
        return np.array([self.ends(label).high for label in self.labels])

    @cached_property
    def scale(self) -> Array:
        """Scales."""
        return np.array([self.ends(label).scale for label in self.labels])


@dataclass(frozen=True)
class Minimum:
    """Result of a search: the parameters, the misfit and its derivatives."""

    point: Array
    misfit: Array
    jacobian: Array

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.misfit @ self.misfit)


@dataclass(frozen=True, eq=False)
class JointModel:
    """The models of several recordings as one.

    Attributes
    ----------
    parts : tuple of ModelOfOne
        One for each recording; all have the same names.
    weights : tuple of float
        Factor on the residuals of each.
    """

    parts: tuple[ModelOfOne, ...]
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

    def _joined(self, what: str, common: Callable[[list[Array]], Array]) -> Array:
        """The common values of a bound or scale, then those of each recording."""
        count = len(self.names)
        ends = [getattr(part, what) for part in self.parts]
        return np.concatenate(
            [common([end[:count] for end in ends]), *(end[count:] for end in ends)]
        )

    @cached_property
    def low(self) -> Array:
        """Lower bounds: the largest over the recordings."""
        return self._joined("low", lambda ends: np.max(ends, axis=0))

    @cached_property
    def high(self) -> Array:
        """Upper bounds: the smallest over the recordings."""
        return self._joined("high", lambda ends: np.min(ends, axis=0))

    @cached_property
    def scale(self) -> Array:
        """Scales of the parameters."""
        return self._joined("scale", lambda ends: ends[0])

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
        count = len(self.names)
        own = [points[0][count:] for points in starts]
        candidates = [
            np.clip(np.concatenate([point[:count], *own]), self.low, self.high)
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


#: A model of one recording, or of several.
Model: TypeAlias = ModelOfOne | JointModel


def solve(model: Model) -> Minimum:
    """Return the lowest minimum from the best starting points."""
    found = [minimise(model, start, tolerance=TO_COMPARE) for start in model.starts()[:REFINED]]
    best = min(found, key=lambda minimum: minimum.cost)
    return minimise(model, best.point)


def minimise(
    model: Model,
    start: Array,
    space: Directions | None = None,
    tolerance: float = TO_ROUNDING,
    evaluations: int = EVALUATIONS,
) -> Minimum:
    """Search from `start` over the points of a space.

    Parameters
    ----------
    model : Model
    start : ndarray, shape (p,)
    space : Directions, optional
        All points if not given.
    tolerance : float
        Relative change of cost and parameters at which the search ends.
    """
    from scipy.optimize import least_squares

    space = all_directions(start.size) if space is None else space
    base, free = space.base, space.free
    if not free.shape[1]:
        return Minimum(base, model.misfit(base), model.jacobian(base))
    low, high = space.bounds(model)

    def misfit(q: Array) -> Array:
        return model.misfit(base + free @ q)

    def jacobian(q: Array) -> Array:
        return model.jacobian(base + free @ q) @ free

    found = least_squares(
        misfit,
        np.clip(start[space.moving], low, high),
        jac=jacobian,
        bounds=(low, high),
        x_scale=model.scale[space.moving],
        xtol=tolerance,
        ftol=tolerance,
        gtol=None,  # an absolute bound, in units of the output squared
        max_nfev=evaluations,
    )
    point = base + free @ found.x
    return Minimum(point, np.asarray(found.fun), model.jacobian(point))


def solve_jointly(parts: Sequence[ModelOfOne]) -> tuple[Model, Minimum]:
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
