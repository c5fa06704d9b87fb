"""Least squares of a loop on the whole recording, from starts, over a grid, or by polynomials.

`Waveform`: least squares from the best of several starts.

The output of the loop, simulated with its hold and its limit at the recording's time stamps, is
fitted to the recorded one. The output at the start of the window is fitted too, because one noisy
sample is a poor initial condition. The cost has several local minima over the delay (a delay that
is longer by a period of the oscillation fits almost as well), so a grid over delay and gain comes
first and its best points are refined, with the exact sensitivities of the loop.

The residuals are white only if the model is complete and the noise is added to the recording alone.
Where the controller acts on the noise (`noise="loop"`), the controller of the model reads the
recorded output instead of the simulated one: the residuals are then the innovations, and they are
white. Both models have the same number of parameters, so the one with the smaller residuals is
likelier. The rows of a sampled controller hold what it read, so the innovations are taken unless
the other model is likelier by far (`noise="auto"`).

`Grid`: cost of the simulated loop over a grid of delays (Leva), its minimum refined.

For each delay of a grid the loop is simulated with its hold and its limit, everything else that is
free (gain, lag, initial output) at its best for that delay, and the sum of squared residuals is
kept: the curve shows every local minimum, where a search finds one. From the lowest points, least
squares over all free parameters gives the minimum and the curvature there, and from it the standard
error, robust where the residuals are coloured.

The input of the model is the reference, so it does not explain sensor noise that the controller
acts on: the standard error from the curvature is then too small, which the residuals do not always
show.

`CTA`: Chebyshev spectral continuous-time approximation (Torkamani & Butcher 2013).

The output over the last delay, y(t + θ) for -Td <= θ <= 0, is approximated by the polynomial
through its values Y_0 … Y_N at the Chebyshev points θ_j = Td/2 (cos(jπ/N) - 1). All but the first
follow from the differentiation matrix, Y_j' = 2/Td (D Y)_j (Trefethen 2000, chapter 6), the first
by the loop,
    Y_0' = v,   lag v' + v = K (r - Y_N)
(v itself the right side without a lag), so the delay equation becomes N + 1 ordinary ones, whose
step response is a sum of exponentials; the reference is a sum of steps. Delay, gain, lag and the
output at the start follow by least squares on the recording.

The polynomial cannot follow the corners that a step leaves, so the delay is biased: at K Td = 0.47
and 1.08 by -1.2 and -4.4 % for N = 2, by -0.06 and -0.4 % for N = 3 and by less than 1e-6 for N =
6. The method is for continuous loops without a limit; it is otherwise the waveform fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

import deadtime.estimation._least_squares as least_squares
import deadtime.estimation.data._checks as checks
import deadtime.estimation.methods._method as base
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import increasing, whole_number
from deadtime.estimation._native import ChebyshevMisfit, FlightProfile, LoopMisfit
from deadtime.estimation._result import CramerRaoBound, DelayEstimate
from deadtime.estimation.data._simulated import SimulatedRecording, shortest_time
from deadtime.estimation.data._step_reading import stiffness_of
from deadtime.estimation.methods._commanded_model import Assumed
from deadtime.estimation.methods._method import Method, OfOne, Read, Run
from deadtime.estimation.methods._output_error import estimate_from_commands
from deadtime.experiments import FlightNoise
from deadtime.loops import ControlLoop

#: Price of air, as ln L, where a fit with it is compared with a simulation without.
PRICE_OF_AIR = 2.0

#: Where sensor noise goes: into the recording alone, or through the controller as well.
NoisePath = Literal["auto", "recording", "loop"]

#: Points of the grids over the delay of `Waveform`, and beside zero of `Grid`: more find a narrow
#: minimum more often and take proportionally longer. Their ends, as shares of the window.
DELAY_POINTS, GRID_POINTS = 24, 24
FIRST, SHORTEST, LONGEST = 0.003, 0.005, 0.6

#: Factors of the grid of `Waveform` over the gain.
GAIN_FACTORS = (0.35, 0.6, 1.0, 1.6)

#: Shortest lag of a sampled loop, as a share of the time between two samples; shorter ones
#: overflow.
LEAST_LAG = 1e-6

#: Noise is taken to be in the recording alone where its log likelihood is larger by this (a factor
#: of 20). Larger values prefer the innovations more often.
LIKELIHOOD_RATIO = 3.0


@dataclass(frozen=True)
class Waveform(Method):
    """Least squares on the simulated response of the whole loop.

    Parameters
    ----------
    noise : {"auto", "recording", "loop"}
        Where the sensor noise goes: ``"recording"`` where it is in the recording alone, ``"loop"``
        where the controller acted on it too. ``"auto"`` takes ``"loop"`` for rows that are the
        samples of a P controller, unless ``"recording"`` is likelier by a factor of 20.
    initial_output : float, optional
        True output at the start of the window; fitted if not given.
    rivals : bool
        Whether other kinds of plant are fitted to one recording too, where something in it is left
        that they could explain. Where one is clearly better, the answer is an indication that
        names it.

    Raises
    ------
    ValueError
        For another `noise`.
    """

    noise: NoisePath = "auto"
    initial_output: float | None = None
    rivals: bool = True

    name: ClassVar[str] = "waveform"
    joint: ClassVar[bool] = True

    def __post_init__(self) -> None:
        base.check_choice("noise", self.noise, get_args(NoisePath))
        base.check_initial_output(self.initial_output)

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the windows of the runs."""
        computed = Assumed(self.initial_output, computed=True)
        factors = set(runs[0].loop.plant.parameters) - set(checks.VEHICLE_PARAMETERS)
        if self.noise == "loop" or (self.noise == "auto" and factors & set(free)):
            return estimate_from_commands(self.name, runs, free, computed)
        simulated = self._by_simulation(runs, free)
        if self.noise == "recording" or not set(free) <= set(checks.VEHICLE_PARAMETERS):
            return simulated
        try:
            innovations = estimate_from_commands(self.name, runs, free, computed)
        except NotIdentifiableError:  # the command cannot be computed, or does not determine `free`
            return simulated
        if simulated.verdict == "reliable" and innovations.verdict != "reliable":
            return simulated
        likelier = _unlikelihood(innovations) - _unlikelihood(simulated)
        return simulated if likelier > LIKELIHOOD_RATIO else innovations

    def _by_simulation(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        names = checks.checked_names(free, runs[0].loop, checks.LOOP_PARAMETERS)
        models = [simulated_model(run, names, self.initial_output) for run in runs]
        model, found = least_squares.solve_jointly(models)
        found = model.problem.without_vanishing(found, model.size)
        checks.check_ends(names, found.point, model.low, model.high)
        return base.concluded(
            self.name,
            model,
            found,
            [Run(part.recording, run.loop) for part, run in zip(models, runs, strict=True)],
            message=f"least squares over {', '.join(names)} on the response of the loop",
            details={
                "initial_output": float([*found.point, self.initial_output][len(names)]),
                "noise": "recording",
            },
        )


def _unlikelihood(fit: DelayEstimate) -> float:
    """Negative log likelihood, but for a constant, of Gaussian noise of unknown size.

    Residuals are taken as no smaller than rounding. Further numbers of the noise have their price.
    """
    if isinstance(fit._profile, FlightProfile):
        fitted = fit._profile.fit
        disturbed = any(noise.air > 0.0 for noise in fitted.numbers.noise)
        return 0.5 * fitted.criterion + PRICE_OF_AIR * disturbed
    total = 0.0
    for run in fit.runs:
        scatter = max(float(np.std(run.residuals)), checks.ROUNDING * checks.excited(run.recording))
        total += run.residuals.size * math.log(scatter)
    return total


@dataclass(frozen=True, eq=False)
class SimulatedModel(least_squares.ModelOfOne):
    """The misfit of the simulated loop, bounded where simulations diverge."""

    simulated: SimulatedRecording
    least_lag: float = LEAST_LAG

    @property
    def kernel(self) -> LoopMisfit:
        """The misfit of the kernel."""
        return self.simulated.misfit(self.names, self.offset, self.size)

    def ends(self, label: str) -> least_squares.Ends:
        """Bounds and starting values of one of the parameters."""
        recording, loop = self.recording, self.simulated.loop
        start, span = checks.start_and_span(recording)
        shortest = lag = shortest_time(recording)
        if loop.is_sampled:
            shortest, lag = 0.0, self.least_lag * recording.sample_time
        delays = (np.geomspace(FIRST, LONGEST, DELAY_POINTS) * span).tolist()
        found = {
            "delay": least_squares.Ends(shortest, span, delays),
            "lag": least_squares.Ends(lag, span, [0.02 * span]),
            "start": least_squares.Ends(-0.25 * span, 0.25 * span, [0.0]),
            "initial output": least_squares.Ends(-np.inf, np.inf, [start]),
        }.get(label)
        if found is not None:
            return found
        value = loop.parameters[label]
        low, high = sorted((1e-3 * value, 1e3 * value))
        factors = GAIN_FACTORS if label == "gain" else (1.0,)
        return least_squares.Ends(low, high, [factor * value for factor in factors])


def simulated_model(
    run: Run, names: tuple[str, ...], offset: float | None = None
) -> SimulatedModel:
    """The model of one recording; refuses one without excitation."""
    simulated = run.simulated
    in_motion = simulated.recording.time[0] > run.recording.time[0]
    checks.check_excitation(simulated.recording, len(names), in_motion=in_motion)
    return SimulatedModel(simulated.recording, names, offset, simulated)


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
            object.__setattr__(self, "delays", tuple(_checked_delays(self.delays).tolist()))
        base.check_initial_output(self.initial_output)

    def names(self, free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
        """The numbers that are asked for."""
        return checks.delay_and(free, loop, "grid")

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, model = run.loop, simulated_model(run, names, self.initial_output)
        model = replace(model, least_lag=0.0)  # where it acts as a delay, a lag is none
        data, labels = model.recording, model.labels
        start, span = checks.start_and_span(data)
        points = np.geomspace(SHORTEST, LONGEST, GRID_POINTS) * span
        grid = np.array([model.low[0], *points[points > model.low[0]]])
        if self.delays is not None:
            grid = np.array(self.delays)
        gain = loop.parameters.get("gain", 1.0)
        guesses = {"gain": gain, "lag": data.sample_time, "initial output": start}
        costs, minima, found = model.problem.scan(
            grid,
            np.array([guesses.get(label, 0.0) for label in labels]),
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
        plain, robust = base.spreads_of(found, labels, loose, model.sizes)
        white = least_squares.whiteness_of(residuals, len(names)).white or base.is_rounding(
            residuals, data
        )
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
            message=_grid_message(names, grid, white),
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


def _checked_delays(delays: ArrayLike) -> Array:
    """The given delays, checked: a minimum has to lie between two of them."""
    grid = increasing("delays", delays)
    if grid.size < 3 or grid[0] < 0.0:
        raise ValueError(
            f"delays contains {grid.size} delays from {grid[0] if grid.size else math.nan:g} "
            "s on: give three or more, all of zero or more"
        )
    return grid


def _grid_message(names: tuple[str, ...], grid: Array, reliable: bool) -> str:
    others = [name for name in names if name != "delay"]
    text = f"least cost over {grid.size} delays from {grid[0]:.3g} to {grid[-1]:.3g} s"
    if others:
        text += f", with {' and '.join(others)} at their best values for each delay"
    if not reliable:
        text += (
            f"{base.COLOURED}, so the loop only approximates the "
            "vehicle, and the standard errors are robust"
        )
    return text


#: Points of the initial grid of `CTA` over the delay; its ends are those of `Grid`.
CTA_POINTS = 20

#: Most intervals: with more, the corners dominate the error.
MOST_NODES = 24


@dataclass(frozen=True)
class CTA(OfOne):
    """The waveform, with Chebyshev's approximation in the place of the delay.

    Parameters
    ----------
    intervals : int
        Degree of the polynomial that stands for the output over one delay, from 1 to 24.
    initial_output : float, optional
        True output at the start of the window; fitted if not given.

    Raises
    ------
    ValueError
        When the number of intervals is out of its range.
    """

    intervals: int = 8
    initial_output: float | None = None

    name: ClassVar[str] = "cta"

    def __post_init__(self) -> None:
        whole_number("intervals", self.intervals, limit=MOST_NODES + 1)
        base.check_initial_output(self.initial_output)

    def names(self, free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
        """The delay, and what else is asked for."""
        names = checks.delay_and(free, loop, "cta")
        stiffness_of(loop, "cta")
        if loop.is_sampled or loop.limit is not None:
            what = "a hold" if loop.is_sampled else "a limit"
            raise ValueError(
                "the cta method is for continuous loops without a limit, but this loop has "
                f"{what}. Use method='waveform' or 'grid', or use loop.continuous() to ignore "
                "the hold on purpose"
            )
        return names

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, data = run.loop, run.simulated.recording
        checks.check_excitation(data, len(names))
        model = _ChebyshevModel(data, names, self.initial_output, loop, self.intervals)
        found = model.problem.solve()
        delay, ends = float(found.point[0]), model.ends("delay")
        if not 1.01 * ends.low < delay < 0.99 * ends.high:
            raise NotIdentifiableError(
                f"the search ends at its bound, a delay of {delay:.3g} "
                "s. So the output is not a response of this loop to "
                "this reference. Check columns, signs and gains"
            )
        count = len(names)
        every = [*range(len(model.labels))]
        cov = base.spreads_of(found, model.labels, every, model.sizes)[1][:count, :count]
        values = model.values(found.point)
        checks.check_gain(values, checks.standard_errors(names, cov))
        return Read(
            values,
            cov,
            model.start_of(found.point),
            message=(
                f"least squares over {', '.join(names)}, with "
                f"the delay line in {self.intervals} intervals"
            ),
            uncalibrated=(
                "the cta method approximates the delay by a polynomial of degree "
                f"{self.intervals}, which biases the estimate. Noise outside the loop gives "
                f"the delay a standard error of {math.sqrt(cov[0, 0]):.2g} s. Use "
                "method='waveform' for an interval"
            ),
            details={
                "intervals": self.intervals,
                "rms_of_approximation": float(np.sqrt(np.mean(found.misfit**2))),
                "initial_output": model.start_of(found.point),
            },
        )


@dataclass(frozen=True, eq=False)
class _ChebyshevModel(least_squares.ModelOfOne):
    """The misfit of the approximated loop."""

    loop: ControlLoop
    intervals: int

    @property
    def kernel(self) -> ChebyshevMisfit:
        """The misfit of the kernel."""
        data = self.recording
        rows = [0, *(step.index for step in data.steps())]
        units = {"lag": data.sample_time, "initial output": self.size}
        return ChebyshevMisfit(
            data.time,
            data.output,
            list(zip(data.time[rows].tolist(), data.reference[rows].tolist(), strict=True)),
            names=self.names,
            known=self.loop.parameters,
            start=self.offset,
            intervals=self.intervals,
            is_late=self.loop.delay_path == "command",
            units=[units.get(label, 0.0) for label in self.labels],
        )

    def ends(self, label: str) -> least_squares.Ends:
        """Bounds and starting values of one of the parameters."""
        start, span = checks.start_and_span(self.recording)
        gain = self.loop.parameters["gain"]
        delays = (np.geomspace(SHORTEST, LONGEST, CTA_POINTS) * span).tolist()
        return {
            "delay": least_squares.Ends(1e-4 * span, span, delays),
            "gain": least_squares.Ends(1e-3 * gain, 1e3 * gain, [gain]),
            "lag": least_squares.Ends(0.0, span, [0.02 * span]),
            "initial output": least_squares.Ends(-np.inf, np.inf, [start]),
        }[label]
