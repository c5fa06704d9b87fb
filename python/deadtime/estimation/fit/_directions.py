"""Spaces of parameters in which a search moves: all of them, or those in which a sum is held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from deadtime._base.arrays import Array


class Bounded(Protocol):
    """What has named parameters with bounds."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the parameters."""

    @property
    def low(self) -> Array:
        """Lower bounds."""

    @property
    def high(self) -> Array:
        """Upper bounds."""


class Directions:
    """The points base + free q.

    Parameters
    ----------
    base : ndarray, shape (p,)
        Point through which the parameters move.
    free : ndarray, shape (p, k)
        Directions in which they move, each with an entry of 1 where the others have 0.
    """

    def __init__(self, base: Array, free: Array) -> None:
        self.base, self.free = base, free
        #: The parameter that each direction moves by one.
        self.moving = np.argmax(free > 0.0, axis=0)

    def bounds(self, model: Bounded) -> tuple[Array, Array]:
        """Bounds of q by those of the parameters."""
        low, high = model.low[self.moving].copy(), model.high[self.moving].copy()
        for row in np.flatnonzero(np.any(self.free < 0.0, axis=1)):
            # base - q has to stay within its own bounds.
            column = int(np.argmin(self.free[row]))
            high[column] = min(high[column], self.base[row] - model.low[row])
        bounded = np.isfinite(low)
        least_width = 1e-12 * (1.0 + np.abs(low[bounded]))
        high[bounded] = np.maximum(high[bounded], low[bounded] + least_width)
        return low, high


def all_directions(count: int) -> Directions:
    """The space of all points."""
    return Directions(np.zeros(count), np.eye(count))


def held_directions(
    model: Bounded, point: Array, names: Sequence[str], value: float, known: Mapping[str, float]
) -> Directions:
    """Base and directions in which the sum of `names` is `value`.

    `known` holds the parameters that are not moved, which may be part of a sum, and `point` the
    best fit.
    """
    labels = model.labels
    value -= sum(known.get(name, 0.0) for name in names if name not in labels)
    places = [labels.index(name) for name in names if name in labels]
    fixed = places[0]
    if len(places) == 1 and value != point[fixed]:
        # Values between zero and the lower bound of the search are not simulated.
        value = max(value, float(model.low[fixed]))
    base = np.zeros(len(labels))
    base[fixed] = value
    free = np.delete(np.eye(len(labels)), fixed, axis=1)
    for place in places[1:]:
        free[fixed, place - (place > fixed)] = -1.0
    return Directions(base, free)
