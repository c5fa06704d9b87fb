"""Least squares over named parameters of one recording, or of several of the same vehicle.

A model gives the misfit (simulated minus recorded output) of its recording and its derivatives; the
kernel searches from the best of several starting points, because the cost has several local minima
over the delay. The parameters of the vehicle are common; each recording has its own initial output.
Recordings are weighted. Where residuals are white, they are noise, and the weight is the inverse of
their standard deviation, which is estimated too (iterated to convergence). Where they are not, the
model is incomplete and its error grows with the motion: the weight is then the inverse of the
excitation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation._native import LeastSquares, LeastSquaresMinimum
from deadtime.estimation.data._checks import excited
from deadtime.estimation.fit._residuals import whiteness_of
from deadtime.recordings import Recording


class Fit(ABC):
    """What the kernel fits: the parameters of one recording, or of several."""

    @property
    @abstractmethod
    def problem(self) -> LeastSquares:
        """The sum of squares."""

    def misfit(self, point: Array) -> Array:
        """Weighted residuals, simulated minus recorded output, one recording after the other."""
        return self.problem.misfit(point)


#: Where a sum of squares is least, with the misfit there and its derivatives.
Minimum: TypeAlias = LeastSquaresMinimum


class Ends(NamedTuple):
    """Bounds of a parameter, and where searches start."""

    low: float
    high: float
    starts: Sequence[float] | Array = ()


@dataclass(frozen=True, eq=False)
class ModelOfOne(Fit):
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

    #: Factor on the residuals of each recording.
    weights = (1.0,)

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

    @abstractmethod
    def ends(self, label: str) -> Ends:
        """Bounds and starting values of one of the parameters."""

    @property
    @abstractmethod
    def kernel(self) -> Any:
        """What gives the misfit: one of the kernel, or an object with `misfit` and `jacobian`."""

    @property
    def problem(self) -> LeastSquares:
        """The model as the kernel fits it."""
        return LeastSquares([self], self.weights, len(self.names), *trading(self.names))

    @cached_property
    def size(self) -> float:
        """Size of the excitation."""
        return excited(self.recording)

    @property
    def length(self) -> int:
        """Samples of the recording."""
        return len(self.recording)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Samples of each recording, in the order of the misfit."""
        return (self.length,)

    @cached_property
    def low(self) -> Array:
        """Lower bounds."""
        return np.array([self.ends(label).low for label in self.labels])

    @cached_property
    def high(self) -> Array:
        """Upper bounds."""
        return np.array([self.ends(label).high for label in self.labels])

    @property
    def axes(self) -> list[list[float]]:
        """Values of each parameter at which searches start, the points of a grid."""
        return [list(self.ends(label).starts) for label in self.labels]


@dataclass(frozen=True, eq=False)
class JointModel(Fit):
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
    def problem(self) -> LeastSquares:
        """The models as the kernel fits them."""
        return LeastSquares(self.parts, self.weights, len(self.names), *trading(self.names))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the common parameters."""
        return self.parts[0].names

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of all parameters: the common ones, then those of each recording."""
        own = [
            f"{label} of recording {number}"
            for number, part in enumerate(self.parts, 1)
            for label in part.labels[len(self.names) :]
        ]
        return (*self.names, *own)

    @property
    def size(self) -> float:
        """Largest excitation of the recordings."""
        return max(part.size for part in self.parts)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Samples of each recording."""
        return tuple(part.length for part in self.parts)

    @property
    def low(self) -> Array:
        """Lower bounds: the tightest of those that are common, then those of each recording."""
        return self.problem.bounds()[0]

    @property
    def high(self) -> Array:
        """Upper bounds."""
        return self.problem.bounds()[1]


#: A model of one recording, or of several.
Model: TypeAlias = ModelOfOne | JointModel


def solve_jointly(parts: Sequence[ModelOfOne]) -> tuple[Model, Minimum]:
    """Return the model of all recordings, its weights included, and its minimum."""
    if len(parts) == 1:
        return parts[0], parts[0].problem.solve()
    sizes = np.array([part.size for part in parts])
    by_size = JointModel(tuple(parts), tuple((sizes.min() / sizes).tolist()))
    first = by_size.problem.solve()
    weights, found = by_size.problem.by_scatter(first)
    model = replace(by_size, weights=tuple(weights))
    if whiteness_of(found.misfit, len(model.names), model.sizes).white:
        return model, found
    return by_size, first


def place_of(name: str, names: Sequence[str]) -> int | None:
    """The place of a name, if it is among them."""
    return names.index(name) if name in names else None


def trading(names: Sequence[str]) -> tuple[int | None, int | None]:
    """The places of the delay and of a lag, which acts like it."""
    return place_of("delay", names), place_of("lag", names)


def without_vanishing(model: Model, found: Minimum) -> Minimum:
    """Set lags and delays to zero where this does not change the cost beyond rounding."""
    return model.problem.without_vanishing(found, *trading(model.names), model.size)
