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
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

import deadtime.estimation.data._checks as checks
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import increasing
from deadtime.estimation._least_squares import place_of, whiteness_of
from deadtime.estimation._result import CramerRaoBound
from deadtime.estimation.methods._method import (
    COLOURED,
    OfOne,
    Read,
    Run,
    check_initial_output,
    is_rounding,
    spreads_of,
)
from deadtime.estimation.methods._waveform import simulated_model
from deadtime.experiments import FlightNoise
from deadtime.loops import ControlLoop

#: Points of the grid besides zero, and its ends as shares of the window.
POINTS, SHORTEST, LONGEST = 24, 0.005, 0.6

#: Two-sided 95 % quantile of the normal distribution.
TWO_SIDED_95 = 1.96


@dataclass(frozen=True)
class Grid(OfOne):
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

    def names(self, free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
        """The numbers that are asked for."""
        return checks.delay_and(free, loop, "grid")

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, model = run.loop, simulated_model(run, names, self.initial_output)
        model = replace(model, least_lag=0.0)  # where it acts as a delay, a lag is none
        data, labels = model.recording, model.labels
        start, span = checks.start_and_span(data)
        points = np.geomspace(SHORTEST, LONGEST, POINTS) * span
        grid = np.array([model.low[0], *points[points > model.low[0]]])
        if self.delays is not None:
            grid = np.array(self.delays)
        gain = loop.parameters.get("gain", 1.0)
        guesses = {"gain": gain, "lag": data.sample_time, "initial output": start}
        costs, minima, found = model.problem.scan(
            grid,
            np.array([guesses.get(label, 0.0) for label in labels]),
            place_of("lag", names),
            len(data) * (checks.ROUNDING * model.size) ** 2,
        )
        if int(np.argmin(costs)) == grid.size - 1:
            raise NotIdentifiableError(
                f"the cost falls up to the longest delay of the grid, {grid[-1]:g} "
                "s. So the output is not a response of this loop to this reference. "
                "Check columns, signs, units and gains, or give other `delays`"
            )
        point, residuals = found.point, -found.misfit
        checks.check_ends(labels, point, model.low, model.high)
        at_zero = point <= model.low * (1.0 + 1e-6) + 1e-9
        loose = [i for i, name in enumerate(labels) if name != "lag" or not at_zero[i]]
        plain, robust = spreads_of(found, labels, loose, model.sizes)
        white = whiteness_of(residuals, len(names)).white or is_rounding(residuals, data)
        cov = plain if white else robust
        errors = checks.standard_errors(names, cov)
        values = model.values(point)
        checks.check_gain(values, errors)
        noise = math.sqrt(found.cost / (residuals.size - len(loose)))
        reach = TWO_SIDED_95 * errors["delay"]
        low, high = max(0.0, float(point[0] - reach)), float(point[0] + reach)
        return Read(
            values,
            cov[: len(names), : len(names)],
            start=model.start_of(point),
            message=_message(names, grid, white),
            uncalibrated=(
                "the grid method ignores that the controller responds "
                "to the noise. Without this response, the delay would "
                f"be {low:.4g} to {high:.4g} s (95 %). Use "
                "method='output_error' or 'waveform' for an interval"
            ),
            details={
                "delays": grid.tolist(),
                "costs": costs.tolist(),
                "local_minima": [float(grid[i]) for i in minima],
                "curvature_interval_95": [low, high],
                "initial_output": model.start_of(point),
            },
            recording=data,
            residuals=residuals,
            crb=CramerRaoBound(labels, FlightNoise(noise), checks.standard_errors(names, plain)),
        )


def _checked(delays: ArrayLike) -> Array:
    """The given delays, checked: a minimum has to lie between two of them."""
    grid = increasing("delays", delays)
    if grid.size < 3 or grid[0] < 0.0:
        raise ValueError(
            f"delays contains {grid.size} delays from {grid[0] if grid.size else math.nan:g} "
            "s on: give three or more, all of zero or more"
        )
    return grid


def _message(names: tuple[str, ...], grid: Array, reliable: bool) -> str:
    others = [name for name in names if name != "delay"]
    text = f"least cost over {grid.size} delays from {grid[0]:.3g} to {grid[-1]:.3g} s"
    if others:
        text += f", with {' and '.join(others)} at their best values for each delay"
    if not reliable:
        text += (
            f"{COLOURED}, so the loop only approximates the "
            "vehicle, and the standard errors are robust"
        )
    return text
