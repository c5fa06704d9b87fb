"""Least squares of the simulated loop on the whole recording.

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
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

import deadtime.estimation._least_squares as least_squares
import deadtime.estimation.data._checks as checks
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import FlightProfile, LoopMisfit
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._simulated import SimulatedRecording, shortest_time
from deadtime.estimation.methods._commanded_model import Assumed
from deadtime.estimation.methods._method import (
    Method,
    Run,
    check_choice,
    check_initial_output,
    concluded,
)
from deadtime.estimation.methods._output_error import estimate_from_commands

#: Price of air, as ln L, where a fit with it is compared with a simulation without.
PRICE_OF_AIR = 2.0

#: Where sensor noise goes: into the recording alone, or through the controller as well.
NoisePath = Literal["auto", "recording", "loop"]

#: Points of the initial grid over the delay, and factors of that over the gain: more points find a
#: narrow minimum more often and take proportionally longer.
DELAY_POINTS = 24
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
        check_choice("noise", self.noise, get_args(NoisePath))
        check_initial_output(self.initial_output)

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
        found = least_squares.without_vanishing(model, found)
        checks.check_ends(names, found.point, model.low, model.high)
        return concluded(
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
        delays = np.geomspace(0.003, 0.6, DELAY_POINTS) * span
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
        factors = np.array(GAIN_FACTORS) if label == "gain" else np.ones(1)
        return least_squares.Ends(low, high, factors * value)


def simulated_model(
    run: Run, names: tuple[str, ...], offset: float | None = None
) -> SimulatedModel:
    """The model of one recording; refuses one without excitation."""
    simulated = run.simulated
    in_motion = simulated.recording.time[0] > run.recording.time[0]
    checks.check_excitation(simulated.recording, len(names), in_motion=in_motion)
    return SimulatedModel(simulated.recording, names, offset, simulated)
