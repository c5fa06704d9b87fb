"""Least squares over named parameters of one recording, or of several of the same vehicle.

A model gives the misfit (simulated minus recorded output) of its recording and its derivatives; the
kernel searches from the best of several starting points, because the cost has several local minima
over the delay. The parameters of the vehicle are common; each recording has its own initial output.
Recordings are weighted. Where residuals are white, they are noise, and the weight is the inverse of
their standard deviation, which is estimated too (iterated to convergence). Where they are not, the
model is incomplete and its error grows with the motion: the weight is then the inverse of the
excitation.

Least squares gives the covariance ``σ² (JᵀJ)⁻¹`` only for residuals that are white. Coloured
ones (an incomplete model, sensor noise that the controller acts on) carry less information than
their number suggests. The kernel has both covariances (`least_squares/covariance.rs`).

A profile is the increase of the cost when one parameter is held. For white Gaussian noise of
unknown size, (cost(value) - best)/(best/freedom) is distributed as the square of Student's t where
the model is nearly linear, and the interval holds all values for which it stays below the quantile
squared (Bates & Watts 1988, section 6.1). Where residuals are coloured, the quantile is widened by
the ratio of robust and plain standard errors.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime.estimation.data._checks import excited
from deadtime.recordings import Recording


@dataclass(frozen=True)
class Whiteness:
    """Ljung and Box's (1978) portmanteau test of residuals.

    Attributes
    ----------
    statistic : float
        Q, chi-squared with `lags` degrees of freedom (less the fitted parameters, summed over
        recordings) for white residuals.
    p_value : float
        Probability that white residuals have a statistic at least as large.
    lags : int
        Number of autocorrelations in Q, of one recording.
    autocorrelation : float
        The autocorrelation at lag one.
    """

    statistic: float
    p_value: float
    lags: int
    autocorrelation: float

    @property
    def white(self) -> bool:
        """Whether the residuals pass for white at the 1 % level."""
        return self.p_value > native.LEVEL_OF_TESTS


def whiteness_of(
    residuals: Array, parameters: int = 0, sizes: Sequence[int] | None = None
) -> Whiteness:
    """Test the residuals of a fit with this number of `parameters` for whiteness.

    Residuals of several recordings, of these `sizes`, are tested one recording at a time, and
    the statistics are added. Residuals of zero pass.
    """
    return Whiteness(*native.whiteness(pieces_of(residuals, sizes), parameters))


def pieces_of(values: Array, sizes: Sequence[int] | None) -> list[Array]:
    """Rows that belong to recordings of these sizes."""
    return [values] if sizes is None else np.split(values, np.cumsum(sizes)[:-1])


class Fit(ABC):
    """What the kernel fits: the parameters of one recording, or of several."""

    @property
    @abstractmethod
    def problem(self) -> native.LeastSquares:
        """The sum of squares."""

    def misfit(self, point: Array) -> Array:
        """Weighted residuals, simulated minus recorded output, one recording after the other."""
        return self.problem.misfit(point)

    @property
    def low(self) -> Array:
        """Lower bounds: the tightest of those that are common, then those of each recording."""
        return self.problem.bounds()[0]

    @property
    def high(self) -> Array:
        """Upper bounds."""
        return self.problem.bounds()[1]


#: Where a sum of squares is least, with the misfit there and its derivatives.
Minimum: TypeAlias = native.LeastSquaresMinimum


class Ends(NamedTuple):
    """Bounds of a parameter, and where searches start."""

    low: float
    high: float
    starts: Sequence[float] = ()


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
    def problem(self) -> native.LeastSquares:
        """The model as the kernel fits it."""
        return native.LeastSquares([self], self.weights, self.names)

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

    @property
    def every_end(self) -> list[Ends]:
        """Bounds of all parameters, and where searches start."""
        return [self.ends(label) for label in self.labels]


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
    def problem(self) -> native.LeastSquares:
        """The models as the kernel fits them."""
        return native.LeastSquares(self.parts, self.weights, self.names)

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


#: Farthest end of an interval, in multiples of the Gaussian one.
FARTHEST = 64.0

#: Accuracy of the ends, in standard errors.
TOLERANCE = 1e-3

#: The search starts at this multiple of the Gaussian interval, so that most ends are bracketed at
#: once.
FIRST_STEP = 1.05


#: Beginnings of the names of times that are not negative, and units of other quantities. Further
#: ones have the unit that their plant gives them.
TIMES = ("delay", "lag", "time_constant")
UNITS = {"zero": "s", "start": "s", "pole_frequency": "rad/s"}

#: Further quantities that are not negative.
POSITIVE = ("limit", "rate", "rate_of_rate", "pole_frequency", "pole_damping")


def floor_of(name: str) -> float:
    """Lower bound of a quantity: zero for times, none for gains and clock offsets."""
    return 0.0 if name.startswith(TIMES) or name in POSITIVE else -np.inf


def unit_of(name: str) -> str:
    """Unit of a quantity; empty where it depends on the units of command and output."""
    return "s" if name.startswith(TIMES) else UNITS.get(name, "")


@dataclass(frozen=True, eq=False)
class Profile:
    """The profile of the cost of one fit.

    Attributes
    ----------
    cost : callable
        Least sum of squares with the named quantity held at a value.
    best : float
        The least sum of squares.
    freedom : int
        Samples less fitted parameters.
    widening : dict of str to float
        Ratio of robust to plain standard error of each quantity.
    preferred : str
        Why the profile interval is preferred to the Gaussian one; empty where it is not.
    """

    cost: Callable[[str, float], float]
    best: float
    freedom: int
    widening: Mapping[str, float]
    preferred: str = ""

    def freedom_of(self, name: str) -> float:
        """Degrees of freedom of the quantile for a quantity."""
        return float(self.freedom)

    def statistic(self, name: str, value: float) -> float:
        """The squared t for which `value` is the end of an interval."""
        increase = max(0.0, self.cost(name, value) - self.best)
        scale = self.best / self.freedom
        widening = self.widening.get(name, 1.0)
        return increase / (scale * widening**2) if scale > 0.0 else float(np.inf) * (increase > 0.0)

    def interval(self, name: str, value: float, stderr: float, level: float) -> tuple[float, float]:
        """Ends of the interval around the fitted `value`, no lower than `floor_of` allows."""
        from scipy import special

        quantile = float(special.stdtrit(self.freedom, 0.5 + level / 2))
        reach = max(stderr, 1e-9 * abs(value), 1e-12)

        def excess(end: float) -> float:
            # At the best fit itself the search for the others may end a little above it.
            rise = self.statistic(name, end) if end != value else 0.0
            return math.sqrt(rise) - quantile  # nearly linear, as the square is not

        step, floor = FIRST_STEP * quantile * reach, floor_of(name)
        low, high = (
            native.interval_end(excess, value, way, floor, FARTHEST * reach, TOLERANCE * reach)
            for way in (-step, step)
        )
        return low, high


def least_cost(
    model: Model, best: Minimum, known: Mapping[str, float], name: str, value: float
) -> float:
    """Least sum of squares with `name`, a parameter or a sum, at `value`, the others free.

    `known` holds the parameters that were not fitted, which may be part of a sum.
    """
    return model.problem.least_held(best, *places_of(name, value, model, known))


def places_of(
    name: str, value: float, model: Model, known: Mapping[str, float]
) -> tuple[list[int], float]:
    """Places of the parameters in a sum, and what they add up to where the sum is `value`.

    `known` holds the parameters that are not moved.
    """
    parts, labels = name.split("+"), model.labels
    value -= sum(known.get(part, 0.0) for part in parts if part not in labels)
    return [labels.index(part) for part in parts if part in labels], value
