"""Cost of the simulated loop over a grid of delays (Leva), its minimum refined.

For each delay of a grid the loop is simulated with its hold and its limit, everything else that is
free (gain, lag, initial output) at its best for that delay, and the sum of squared residuals is
kept: the curve shows every local minimum, where a search finds one. From the lowest points, least
squares over all free parameters gives the minimum and the curvature there, and from it the standard
error, robust where the residuals are coloured.

The input of the model is the reference, so it does not explain sensor noise that the controller
acts on: the standard error from the curvature is then too small, which the residuals do not always
show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import increasing
from deadtime.estimation._result import CramerRaoBound, DelayEstimate
from deadtime.estimation.data._checks import (
    ROUNDING,
    check_delay_free,
    check_distinguishable,
    check_ends,
    check_excitation,
    check_gain,
    checked_names,
    embedded,
    standard_errors,
    start_and_span,
)
from deadtime.estimation.data._simulated import SimulatedRecording, shortest_time
from deadtime.estimation.fit._directions import Directions, all_directions
from deadtime.estimation.fit._least_squares import Ends, minimise
from deadtime.estimation.fit._residuals import robust_covariance, white_covariance, whiteness_of
from deadtime.estimation.methods._conclusion import COLOURED, estimate_with_residuals, is_rounding
from deadtime.estimation.methods._method import Method, Run, check_initial_output
from deadtime.estimation.methods._waveform import SimulatedModel
from deadtime.experiments import FlightNoise

#: Points of the grid besides zero, and its ends as shares of the window.
POINTS, SHORTEST, LONGEST = 24, 0.005, 0.6

#: Local minima of the curve that are refined; the lowest is taken.
REFINED = 3

#: A lag is set to zero where this raises the cost by no more than this share: next to zero it acts
#: like a delay, and the two cannot be distinguished.
VANISHING = 1e-6

#: Relative change of cost or parameters at which a search ends, and its most evaluations.
TOLERANCE, EVALUATIONS = 1e-12, 60

#: Two-sided 95 % quantile of the normal distribution.
TWO_SIDED_95 = 1.96


@dataclass(frozen=True)
class Grid(Method):
    """Cost of the simulated loop over a grid of delays, its lowest point refined.

    Parameters
    ----------
    delays : array_like, shape (n,), optional
        Delays to try in s, increasing, three at least, none below zero. By default 25 from zero
        to 60 % of the window.
    initial_output : float, optional
        True output at the start of the window; fitted if not given.

    Raises
    ------
    ValueError
        When the delays are fewer than three, do not increase, or are negative.
    """

    delays: ArrayLike | None = None
    initial_output: float | None = None

    name: ClassVar[str] = "grid"

    def __post_init__(self) -> None:
        if self.delays is not None:
            object.__setattr__(self, "delays", tuple(_checked(self.delays).tolist()))
        check_initial_output(self.initial_output)

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        ((recording, loop, window, *_),) = runs
        names = checked_names(free, loop)
        check_delay_free(names, "grid")
        simulated = SimulatedRecording(recording, loop, window)
        data = simulated.recording
        check_excitation(data, len(names))
        problem = _Problem(data, names, self.initial_output, simulated)
        grid = problem.grid() if self.delays is None else np.array(self.delays)
        costs, points = problem.over(grid)
        point = problem.refined(costs, points)
        check_ends(problem.labels, point, problem.low, problem.high)

        misfit, jacobian = problem.misfit(point), problem.jacobian(point)
        residuals = -misfit
        at_zero = point <= problem.low * (1.0 + 1e-6) + 1e-9
        loose = [i for i, name in enumerate(problem.labels) if name != "lag" or not at_zero[i]]
        check_distinguishable(jacobian[:, loose], [problem.labels[i] for i in loose])
        whiteness = whiteness_of(residuals, len(names))
        reliable = whiteness.white or is_rounding(residuals, data)
        size, count = len(problem.labels), len(names)
        white = embedded(white_covariance(jacobian[:, loose], residuals), loose, size)
        spread = white
        if not reliable:
            spread = embedded(robust_covariance(jacobian[:, loose], residuals), loose, size)
        errors = standard_errors(names, spread)
        values = problem.values(point)
        check_gain(values, errors)
        noise = math.sqrt(float(misfit @ misfit) / (residuals.size - len(loose)))
        low, high = (errors["delay"] * side for side in (-TWO_SIDED_95, TWO_SIDED_95))
        return estimate_with_residuals(
            "grid",
            loop,
            data,
            values,
            spread[:count, :count],
            residuals,
            crb=CramerRaoBound(problem.labels, FlightNoise(noise), standard_errors(names, white)),
            message=_message(names, grid, reliable),
            uncalibrated=(
                "the grid method fits the response to the reference, without the noise that the "
                "controller acts on: the curvature of the cost gives "
                f"{max(0.0, point[0] + low):.4g} to {point[0] + high:.4g} s (95 %), which has "
                "this coverage only where the controller does not act on the noise; use "
                "method='output_error' or 'waveform' for an interval"
            ),
            details={
                "delays": grid.tolist(),
                "costs": costs.tolist(),
                "local_minima": [float(grid[i]) for i in _local_minima(costs)],
                "curvature_interval_95": [max(0.0, float(point[0] + low)), float(point[0] + high)],
                "initial_output": problem.start_of(point),
            },
        )


def _checked(delays: ArrayLike) -> Array:
    """The given delays, checked: a minimum has to lie between two of them."""
    grid = increasing("delays", delays)
    if grid.size < 3 or grid[0] < 0.0:
        raise ValueError(
            f"delays: {grid.size} from {grid[0] if grid.size else math.nan:g} s; give three at "
            "least, none below zero"
        )
    return grid


def _local_minima(costs: Array) -> list[int]:
    """Rows of the grid with a lower cost than both neighbours."""
    middle = costs[1:-1]
    return [int(i) + 1 for i in np.flatnonzero((middle < costs[:-2]) & (middle <= costs[2:]))]


@dataclass(frozen=True, eq=False)
class _Problem(SimulatedModel):
    """The misfit as a function of the parameters, the delay first."""

    @cached_property
    def size(self) -> float:
        """The larger range of output and reference."""
        return max(float(np.ptp(self.recording.output)), float(np.ptp(self.recording.reference)))

    @cached_property
    def span(self) -> float:
        """Time from the first step to the end, s."""
        return start_and_span(self.recording)[1]

    @property
    def gain(self) -> float:
        """The known gain."""
        return self.simulated.loop.parameters.get("gain", 1.0)

    def ends(self, label: str) -> Ends:
        """Bounds of the search, and scales."""
        low, high = sorted((1e-3 * self.gain, 1e3 * self.gain))
        time = Ends(self.shortest, self.span, self.recording.sample_time)
        found = {"delay": time, "gain": Ends(low, high, abs(self.gain)), "lag": time}
        return found.get(label, Ends(-np.inf, np.inf, self.size))

    def starts(self) -> list[Array]:
        """The point from which each delay is tried."""
        start, _ = start_and_span(self.recording)
        guesses = {"gain": self.gain, "lag": self.recording.sample_time, "initial output": start}
        return [np.array([guesses.get(label, 0.0) for label in self.labels])]

    @property
    def shortest(self) -> float:
        """Shortest delay and lag of the search."""
        if self.simulated.loop.is_sampled:
            return 0.0
        return shortest_time(self.recording)

    def grid(self) -> Array:
        """Delays from the shortest on, spaced geometrically."""
        points = np.geomspace(SHORTEST, LONGEST, POINTS) * self.span
        return np.concatenate([[self.shortest], points[points > self.shortest]])

    def cost(self, point: Array) -> float:
        """Sum of squares."""
        misfit = self.misfit(point)
        return float(misfit @ misfit)

    def jacobian(self, point: Array, first: int = 0) -> Array:
        """Derivatives by the parameters from the `first` on; one-sided at a bound."""
        columns = []
        for place in range(first, point.size):
            step = 1e-5 * self.scale[place]
            up, down = point.copy(), point.copy()
            up[place] += step
            down[place] = max(self.low[place], down[place] - step)
            change = up[place] - down[place]
            columns.append((self.misfit(up) - self.misfit(down)) / change)
        return np.stack(columns, axis=1)

    def over(self, grid: Array) -> tuple[Array, Array]:
        """Least cost at each delay, and the parameters there."""
        (guess,) = self.starts()
        costs, points = np.empty(grid.size), np.empty((grid.size, guess.size))
        point = guess
        for row, delay in enumerate(grid):
            starts = [np.concatenate([[delay], start[1:]]) for start in (guess, point)]
            point = self._improved(min(starts, key=self.cost))
            costs[row], points[row] = self.cost(point), point
        if int(np.argmin(costs)) == grid.size - 1:
            raise NotIdentifiableError(
                f"the cost falls up to a delay of {grid[-1]:g} s, the longest of the grid: the "
                "output is no response of such a loop to this reference; check columns, signs, "
                "units and gains, or give other `delays`"
            )
        return costs, points

    def _improved(self, point: Array) -> Array:
        """A Gauss-Newton step in all parameters but the delay, if it reduces the cost."""
        if point.size == 1:
            return point
        jacobian = self.jacobian(point, first=1)
        change = np.linalg.lstsq(jacobian, -self.misfit(point), rcond=None)[0]
        moved = point.copy()
        moved[1:] = np.clip(point[1:] + change, self.low[1:], self.high[1:])
        return min((point, moved), key=self.cost)

    def refined(self, costs: Array, points: Array) -> Array:
        """The lowest of the refined local minima."""
        minima = sorted({int(np.argmin(costs)), *_local_minima(costs)}, key=lambda row: costs[row])
        found = [self._minimised(points[row]) for row in minima[:REFINED]]
        return self._without_lag(min(found, key=self.cost))

    def _without_lag(self, point: Array) -> Array:
        """The point with the shortest lag and a longer delay, where that fits as well."""
        if "lag" not in self.labels:
            return point
        delay, lag = self.labels.index("delay"), self.labels.index("lag")
        without = point.copy()
        without[delay] += point[lag] - self.low[lag]
        without[lag] = self.low[lag]
        without = self._minimised(without, held=lag)
        rounding = len(self.recording) * (ROUNDING * self.size) ** 2
        as_well = self.cost(without) <= self.cost(point) * (1.0 + VANISHING) + rounding
        return without if as_well else point

    def _minimised(self, point: Array, held: int | None = None) -> Array:
        """Least squares over all parameters, or all but one, from a point."""
        space = all_directions(point.size)
        if held is not None:
            base = np.where(np.arange(point.size) == held, point, 0.0)
            space = Directions(base, np.delete(space.free, held, axis=1))
        return minimise(self, point, space, TOLERANCE, EVALUATIONS).point


def _message(names: tuple[str, ...], grid: Array, reliable: bool) -> str:
    others = [name for name in names if name != "delay"]
    text = f"least cost over {grid.size} delays from {grid[0]:.3g} to {grid[-1]:.3g} s"
    if others:
        text += f", {' and '.join(others)} at their best values for each"
    if not reliable:
        text += (
            f"{COLOURED}, so the loop only approximates the vehicle and "
            "the standard errors are robust ones"
        )
    return text
