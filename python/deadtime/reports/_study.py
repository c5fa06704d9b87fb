"""From one recording to gains: estimate, map, design, and fly the design on paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deadtime.estimation import Comparison, DelayEstimate, compare_methods
from deadtime.loops import PV, Controller, ControlLoop, Integrator, P, kit_plant
from deadtime.loops._derivative_filter import PAPER_FILTER
from deadtime.recordings import Recording
from deadtime.systems import Response
from deadtime.tuning import Design, critical_gain, design

__all__ = ["DemoFlight", "Study", "demo_flight", "study"]

#: Share of the stability limit beyond which a gain is called unsafe: the usual gain margin of 2.
SAFE_SHARE = 0.5

#: How long a design is watched after its step, s.
WATCHED = 8.0


@dataclass(frozen=True)
class DemoFlight:
    """A simulated flight whose truth is known.

    Attributes
    ----------
    recording : Recording
        What the ground station logs.
    known : ControlLoop
        What it knows of the loop: gains, sample time, limit.
    truth : ControlLoop
        The loop that was flown.
    numbers : dict of str to float
        The truth in the terms of the estimators: ``delay`` (less the lead of the plant's zero),
        ``gain``, ``lag``, ``delay+lag``.
    window : (float, float)
        The part around the step to estimate from, s.
    """

    recording: Recording
    known: ControlLoop
    truth: ControlLoop
    numbers: dict[str, float]
    window: tuple[float, float]


def demo_flight(seed: int = 1, noise: float = 0.002) -> DemoFlight:
    """Fly the height loop of the AR Drone development kit, with noise on its height.

    The plant is the kit's identified height model behind 0.26 s of communication delay, sampled
    every 65 ms, its vertical speed limited to 1 m/s.

    Parameters
    ----------
    seed : int
        Seed of the noise.
    noise : float
        Standard deviation of the measured height, m.
    """
    step = 0.065
    controller = P(Kp=2.4)
    plant = kit_plant()
    truth = ControlLoop(plant, controller, delay=0.26, sample_time=step, limit=1.0)
    time = np.arange(462) * step
    reference = np.where(time < 5.0, 0.0, np.where(time < 15.0, 1.0, 1.25))
    error = np.random.default_rng(seed).normal(0.0, noise, time.size)
    # Under proportional control noise on the measurement acts as noise on the reference would.
    flown = truth.simulate(time, reference - error, reference_time=time, initial_output=0.0)
    recording = Recording(
        time, reference, flown.outputs + error, units={"output": "m"}, source="simulated flight"
    )
    # (b1 s + b0) / (s (s + a)): gain b0/a, lag 1/a, and a zero that leads by b1/b0. A model of
    # delay and lag alone sees the lead as so much less delay.
    (b1, b0), (_, a, _) = plant.num, plant.den
    numbers = {
        "delay": 0.26 - b1 / b0,
        "gain": b0 / a,
        "lag": 1.0 / a,
        "delay+lag": 0.26 + 1.0 / a - b1 / b0,
    }
    known = ControlLoop(Integrator(), controller, sample_time=step, limit=1.0)
    return DemoFlight(recording, known, truth, numbers, (13.0, 25.5))


@dataclass(frozen=True)
class Study:
    """What a recording of a loop leads to.

    Attributes
    ----------
    recording : Recording
        The whole recording.
    known : ControlLoop
        What was known of the loop beforehand.
    window : (float or None, float or None) or None
        The part the estimates are from.
    comparison : Comparison
        The delay by every method that applies.
    held_limit, continuous_limit : float
        Proportional gain at which the fitted loop loses stability, with its hold and without.
    designed : Design
        Gains made for the delay and its uncertainty.
    naive : Design
        Gains made in the same way for the same vehicle as if there were no delay.
    gain_margin : float
        Factor by which the gain of the designed loop may grow until it is unstable.
    largest_delay : float
        Delay up to which the designed loop is stable, s.
    responses : dict of str to Response
        Unit steps of the loop (the true one where it is known, else the fitted one) under both.
    flown_on : str
        Which loop the responses are of.
    truth : DemoFlight or None
        The truth, where there is one.
    """

    recording: Recording
    known: ControlLoop
    window: tuple[float | None, float | None] | None
    comparison: Comparison
    held_limit: float
    continuous_limit: float
    designed: Design
    naive: Design
    gain_margin: float
    largest_delay: float
    responses: dict[str, Response]
    flown_on: str
    truth: DemoFlight | None = None

    @property
    def fit(self) -> DelayEstimate:
        """The estimate the gains are made for."""
        return self.comparison.best

    def safe_gain(self) -> float:
        """Proportional gain with a gain margin of 2."""
        return SAFE_SHARE * self.held_limit

    def verdict(self) -> str:
        """The outcome in a few sentences."""
        fit = self.fit
        name = "delay+lag" if "lag" in fit.free else "delay"
        late = fit.delay_plus_lag if "lag" in fit.free else fit.delay
        low, high = fit.ci(0.95, name)
        parts = " (delay and lag together)" if "lag" in fit.free else ""
        gains = ", ".join(f"{key} = {value:.3g}" for key, value in self.designed.gains.items())
        said = [
            f"The loop is {late:.2f} s late{parts}, between {low:.3f} and {high:.3f} s with 95 % "
            "confidence.",
            f"Under proportional control Kp above {self.safe_gain():.2f} is unsafe (less than a "
            f"factor of 2 from instability at {self.held_limit:.2f}"
            + (
                f"; the hold counts, without it the limit would seem to be "
                f"{self.continuous_limit:.2f})."
                if self.known.is_sampled
                else ")."
            ),
            f"Try {gains}: a step {_settles(self.responses['designed for the delay'])}, and the "
            f"loop stays stable until its gain is {self.gain_margin:.1f} times what it was found "
            f"to be, or its delay {self.largest_delay:.2f} s. After gains made as if there were no "
            f"delay a step {_settles(self.responses['designed without the delay'])}.",
        ]
        return " ".join(said)


def study(
    recording: Recording,
    loop: ControlLoop,
    *,
    window: tuple[float | None, float | None] | None = None,
    truth: DemoFlight | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Study:
    """Estimate the delay of a recorded loop and design a controller for it.

    Parameters
    ----------
    recording, loop, window
        As for `estimate_delay`.
    truth : DemoFlight, optional
        The truth of a simulated flight, to be reported beside the estimates.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Returns
    -------
    Study
    """
    progress("estimating the delay")
    comparison = compare_methods(recording, loop, window)
    fitted = comparison.best.loop
    progress("finding the limits of the gain")
    held = critical_gain(fitted)
    continuous = critical_gain(fitted.continuous())
    progress("mapping the gains")
    template = PV(Kp=1.0, Kv=0.1, filter=PAPER_FILTER)
    interval = comparison.best.ci(0.95, "delay")
    designed = design(fitted, controller=template, delay=interval)
    progress("designing without the delay, for contrast")
    naive = design(fitted, controller=template, delay=0.0)
    progress("flying both designs")
    flown = fitted if truth is None else truth.truth
    responses = {
        "designed for the delay": _fly(flown, designed.loop.controller),
        "designed without the delay": _fly(flown, naive.loop.controller),
    }
    return Study(
        recording=recording,
        known=loop,
        window=window,
        comparison=comparison,
        held_limit=held,
        continuous_limit=continuous,
        designed=designed,
        naive=naive,
        gain_margin=designed.loop.stable_range("gain")[1] / designed.loop.parameters["gain"],
        largest_delay=designed.loop.stable_range("delay")[1],
        responses=responses,
        flown_on="the fitted loop" if truth is None else "the true loop",
        truth=truth,
    )


def _fly(loop: ControlLoop, controller: Controller) -> Response:
    time = np.linspace(0.0, WATCHED, 801)
    return loop.replace(controller=controller).simulate(time)


def _settles(response: Response) -> str:
    """Whether and when a response settles, in words that follow "a step"."""
    info = response.info()
    if np.isfinite(info["settling_time"]):
        return (
            f"settles to 2 % in {info['settling_time']:.1f} s with {info['overshoot']:.0f} % "
            "overshoot"
        )
    swing = float(np.ptp(response.outputs[response.time > 0.5 * response.time[-1]]))
    return f"has not settled after {response.time[-1]:g} s (it still swings by {swing:.2g})"
