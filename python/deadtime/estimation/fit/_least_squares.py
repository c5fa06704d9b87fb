"""Least squares over named parameters: a minimum, and the minimum with one quantity held.

A model gives the misfit (simulated minus recorded output) of its recordings and its derivatives.
The search is SciPy's trust-region method from a few starting points, because the cost has several
local minima over the delay. With a quantity held, the other parameters are minimised over; delay +
lag is held by changing the delay opposite to the lag.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Ends", "Minimum", "Model", "ModelOfOne", "ProfileCost", "minimise", "solve"]

Array = NDArray[np.float64]

#: Starting points that are refined; the best minimum is taken.
REFINED = 3

#: Most evaluations of one search.
EVALUATIONS = 200

#: Relative change of cost or parameters at which a search ends: at rounding for a result; earlier
#: where minima are compared or only the cost is needed, which is flat there.
TO_ROUNDING, TO_COMPARE = 1e-14, 1e-6


class Model(Protocol):
    """Misfit of one or several recordings as a function of parameters.

    Attributes
    ----------
    labels : tuple of str
        Names of all parameters: `names` first, then the further fitted ones.
    names : tuple of str
        Names of the parameters to be estimated.
    low, high, scale : ndarray, shape (p,)
        Bounds and scales.
    size : float
        Size of the excitation.
    sizes : tuple of int
        Samples of each recording, in the order of the misfit.
    """

    @property
    def labels(self) -> tuple[str, ...]: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def low(self) -> Array: ...
    @property
    def high(self) -> Array: ...
    @property
    def scale(self) -> Array: ...
    @property
    def size(self) -> float: ...
    @property
    def sizes(self) -> tuple[int, ...]: ...
    def misfit(self, point: Array) -> Array:
        """Simulated minus recorded output, shape (n,)."""

    def jacobian(self, point: Array) -> Array:
        """Derivatives of the misfit, shape (n, p)."""

    def starts(self) -> list[Array]:
        """Starting points, the best first."""


class Ends(NamedTuple):
    """Bounds and scale of a parameter."""

    low: float
    high: float
    scale: float


class ModelOfOne(ABC):
    """Base of models of one recording: bounds and scales by the names of parameters."""

    @property
    @abstractmethod
    def labels(self) -> tuple[str, ...]:
        """Names of the parameters."""

    @abstractmethod
    def ends(self, label: str) -> Ends:
        """Bounds and scale of one of them."""

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


def solve(model: Model) -> Minimum:
    """Return the lowest minimum from the best starting points."""
    found = [minimise(model, start, tolerance=TO_COMPARE) for start in model.starts()[:REFINED]]
    best = min(found, key=lambda minimum: minimum.cost)
    return minimise(model, best.point)


def minimise(
    model: Model,
    start: Array,
    base: Array | None = None,
    free: Array | None = None,
    tolerance: float = TO_ROUNDING,
) -> Minimum:
    """Search from `start` over the points base + free q.

    Parameters
    ----------
    model : Model
    start : ndarray, shape (p,)
    base : ndarray, shape (p,), optional
        Point through which the parameters move; the origin if not given.
    free : ndarray, shape (p, k), optional
        Directions in which they move, each with an entry of 1 where the others have 0; all
        directions if not given.
    tolerance : float
        Relative change of cost and parameters at which the search ends.
    """
    from scipy.optimize import least_squares

    base = np.zeros(start.size) if base is None else base
    free = np.eye(start.size) if free is None else free
    moving = np.argmax(free > 0.0, axis=0)
    low, high = model.low[moving].copy(), model.high[moving].copy()
    for row in np.flatnonzero(np.any(free < 0.0, axis=1)):
        # base - q has to stay within its own bounds.
        column = int(np.argmin(free[row]))
        high[column] = min(high[column], base[row] - model.low[row])
    if not free.shape[1]:
        return Minimum(base, model.misfit(base), model.jacobian(base))
    bounded = np.isfinite(low)
    least_width = 1e-12 * (1.0 + np.abs(low[bounded]))
    high[bounded] = np.maximum(high[bounded], low[bounded] + least_width)

    def misfit(q: Array) -> Array:
        return model.misfit(base + free @ q)

    def jacobian(q: Array) -> Array:
        return model.jacobian(base + free @ q) @ free

    found = least_squares(
        misfit,
        np.clip(start[moving], low, high),
        jac=jacobian,
        bounds=(low, high),
        x_scale=model.scale[moving],
        xtol=tolerance,
        ftol=tolerance,
        gtol=tolerance,
        max_nfev=EVALUATIONS,
    )
    point = base + free @ found.x
    return Minimum(point, np.asarray(found.fun), model.jacobian(point))


@dataclass(frozen=True)
class ProfileCost:
    """Least cost with one quantity held, the others free.

    The search starts from the minimum of the linearised model. `known` holds the parameters that
    were not fitted, which may be part of a sum.
    """

    model: Model
    best: Minimum
    known: Mapping[str, float]

    def __call__(self, name: str, value: float) -> float:
        """Return the least sum of squares with `name`, a parameter or a sum, at `value`."""
        base, free = self._held(name.split("+"), value)
        least = minimise(self.model, self._linear(base, free), base, free, TO_COMPARE).cost
        # A parameter that is zero in the best fit is tried at zero here too.
        for place in np.flatnonzero(self.best.point < self.model.low):
            column = np.flatnonzero(free[place] == 1.0)
            if column.size:
                base[place] = self.best.point[place]
                without = np.delete(free, column, axis=1)
                start = self._linear(base, without)
                found = minimise(self.model, start, base, without, TO_COMPARE)
                least = min(least, found.cost)
        return least

    def _linear(self, base: Array, free: Array) -> Array:
        """Minimum of the linearised model with one quantity held."""
        jacobian = self.best.jacobian
        away = jacobian @ (self.best.point - base)
        moved, *_ = np.linalg.lstsq(jacobian @ free, away, rcond=None)
        return np.asarray(base + free @ moved)

    def _held(self, names: Sequence[str], value: float) -> tuple[Array, Array]:
        """Base and directions in which the sum of `names` is `value`."""
        labels = self.model.labels
        value -= sum(self.known.get(name, 0.0) for name in names if name not in labels)
        places = [labels.index(name) for name in names if name in labels]
        fixed = places[0]
        if len(places) == 1 and value != self.best.point[fixed]:
            # Values between zero and the lower bound of the search are not simulated.
            value = max(value, float(self.model.low[fixed]))
        base = np.zeros(len(labels))
        base[fixed] = value
        free = np.delete(np.eye(len(labels)), fixed, axis=1)
        for place in places[1:]:
            free[fixed, place - (place > fixed)] = -1.0
        return base, free
