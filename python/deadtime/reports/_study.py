"""`study`: from one recording to gains, by estimation, design and simulation of the design."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from deadtime._base.progress import Stages, stage_report
from deadtime._base.validation import OpenRange
from deadtime._base.verdicts import NOT_CLAIMED, Verdict, rough
from deadtime.estimation import Comparison, DelayEstimate, compare_methods
from deadtime.experiments import Experiment, Noise
from deadtime.loops import PAPER_FILTER, PV, Controller, ControlLoop, Integrator, P, kit_plant
from deadtime.recordings import Recording
from deadtime.systems import Response
from deadtime.tuning import Design, critical_gain, design

#: Largest safe gain as a share of the stability limit: the usual gain margin of 2.
SAFE_SHARE = 0.5

#: Simulated time of a step response, s.
DURATION = 8.0


@dataclass(frozen=True)
class DemoRecording:
    """A simulated recording, with the loop that made it.

    Attributes
    ----------
    recording : Recording
        The log of the ground station.
    known : ControlLoop
        The known part of the loop: gains, sample time, limit.
    truth : ControlLoop
        The simulated loop.
    numbers : dict of str to float
        The true parameters as the estimators define them: ``delay`` (less the lead of the plant's
        zero), ``gain``, ``lag``, ``delay+lag``.
    window : (float, float)
        The part around the step for the estimation, s.
    """

    recording: Recording
    known: ControlLoop
    truth: ControlLoop
    numbers: dict[str, float]
    window: tuple[float, float]


def demo_recording(seed: int = 1, noise: Noise = 0.002) -> DemoRecording:
    """Simulate the height loop of the AR Drone development kit, with noise on its height.

    The plant is the kit's identified height model behind 0.26 s of communication delay, sampled
    every 65 ms, its vertical speed limited to 1 m/s.

    Parameters
    ----------
    seed : int
        Seed of the noise.
    noise : float or NoiseModel
        Noise of the measured height, m: the standard deviation of white noise, or a model.
    """
    step = 0.065
    controller = P(Kp=2.4)
    plant = kit_plant()
    truth = ControlLoop(plant, controller, delay=0.26, sample_time=step, limit=1.0)
    time = np.arange(462) * step
    reference = np.where(time < 5.0, 0.0, np.where(time < 15.0, 1.0, 1.25))
    logged = Experiment(time, reference).run(truth, noise, seed)
    recording = replace(logged, command=None, units={"output": "m"}, source="simulated flight")
    # (b1 s + b0) / (s (s + a)): gain b0/a, lag 1/a, and a zero with a lead of b1/b0. In a model of
    # delay and lag the lead shortens the delay.
    (b1, b0), (_, a, _) = plant.num, plant.den
    numbers = {
        "delay": 0.26 - b1 / b0,
        "gain": b0 / a,
        "lag": 1.0 / a,
        "delay+lag": 0.26 + 1.0 / a - b1 / b0,
    }
    known = ControlLoop(Integrator(), controller, sample_time=step, limit=1.0)
    return DemoRecording(recording, known, truth, numbers, (13.0, 25.5))


@dataclass(frozen=True)
class Study:
    """A recording, the estimates from it, and the gains designed for them.

    Attributes
    ----------
    recording : Recording
        The whole recording.
    known : ControlLoop
        The known part of the loop.
    window : (low, high) or None
        The part used for the estimates, s.
    comparison : Comparison
        The delay by every method that applies.
    held_limit, continuous_limit : float
        Proportional gain at which the fitted loop loses stability, with its hold and without.
    designed : Design
        Gains designed for the delay and its uncertainty.
    naive : Design
        Gains designed in the same way without a delay.
    gain_margin : float
        Factor on the gain at which the designed loop becomes unstable.
    largest_delay : float
        Delay up to which the designed loop is stable, s.
    responses : dict of str to Response
        Unit steps of the loop (the true one where it is known, else the fitted one) under both.
    simulated_loop : str
        Which loop the responses are of, in words.
    truth : DemoRecording or None
        The simulated recording, with the true loop, where it is known.
    """

    recording: Recording
    known: ControlLoop
    window: OpenRange | None
    comparison: Comparison
    held_limit: float
    continuous_limit: float
    designed: Design
    naive: Design
    gain_margin: float
    largest_delay: float
    responses: dict[str, Response]
    simulated_loop: str
    truth: DemoRecording | None = None

    @property
    def fit(self) -> DelayEstimate:
        """The estimate for which the gains are designed."""
        return self.comparison.best

    def safe_gain(self) -> float:
        """Proportional gain with a gain margin of 2."""
        return SAFE_SHARE * self.held_limit

    @property
    def verdict(self) -> Verdict:
        """Whether the interval of the delay is claimed to hold: that of `fit`."""
        return self.fit.verdict

    def headline(self) -> str:
        """The outcome in a few sentences, the verdict first."""
        fit = self.fit
        name = "delay+lag" if "lag" in fit.free else "delay"
        late = fit.delay_plus_lag if "lag" in fit.free else fit.delay
        low, high = fit.ci(0.95, name)
        parts = " (delay and lag together)" if "lag" in fit.free else ""
        gains = ", ".join(f"{key} = {value:.3g}" for key, value in self.designed.gains.items())
        sentences = [
            f"Reliable: the delay of the loop is {late:.3f} s{parts}, between {low:.3f} and "
            f"{high:.3f} s (95 %)."
            if self.verdict == "reliable"
            else f"Indication: the delay of the loop is about {rough(late, 's')}{parts}, "
            f"{NOT_CLAIMED}; {fit.reason}.",
            f"Under proportional control the loop is unstable above Kp = {self.held_limit:.2f}, "
            f"so keep Kp below {self.safe_gain():.2f}.",
            f"Try {gains}. With these gains a step "
            f"{_settles(self.responses['designed for the delay'])}.",
            f"The loop stays stable up to {self.gain_margin:.1f} times the estimated gain, or "
            f"up to a delay of {self.largest_delay:.2f} s.",
            "With gains that were designed without the delay, a step "
            f"{_settles(self.responses['designed without the delay'])}.",
        ]
        return " ".join(sentences)


def study(
    recording: Recording,
    loop: ControlLoop,
    *,
    window: OpenRange | None = None,
    truth: DemoRecording | None = None,
    progress: Stages = False,
) -> Study:
    """Estimate the delay of a recorded loop and design a controller for it.

    Parameters
    ----------
    recording, loop, window
        As for `estimate_delay`.
    truth : DemoRecording, optional
        The simulated recording with its true loop, to report beside the estimates.
    progress : bool or callable
        Called with the name of each stage as it begins; True prints the names on stderr.

    Returns
    -------
    Study
    """
    report = stage_report(progress)
    report("estimating the delay")
    comparison = compare_methods(recording, loop, window)
    fitted = comparison.best.loop
    report("finding the limits of the gain")
    held = critical_gain(fitted)
    continuous = critical_gain(fitted.continuous())
    report("mapping the gains")
    template = PV(Kp=1.0, Kv=0.1, filter=PAPER_FILTER)
    interval = comparison.best.ci(0.95, "delay")
    designed = design(fitted, controller=template, delay=interval, objective="abscissa")
    report("designing without the delay, for comparison")
    # Without delay and hold no gain is too large: the same gains are looked at as with the delay.
    axes = designed.charts[0].axes.items()
    same = None if fitted.is_sampled else {name: (axis[0], axis[-1]) for name, axis in axes}
    naive = design(fitted, controller=template, delay=0.0, ranges=same, objective="abscissa")
    report("simulating both designs")
    loop_of_responses = fitted if truth is None else truth.truth
    responses = {
        "designed for the delay": _step_response(loop_of_responses, designed.loop.controller),
        "designed without the delay": _step_response(loop_of_responses, naive.loop.controller),
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
        simulated_loop="the fitted loop" if truth is None else "the true loop",
        truth=truth,
    )


def _step_response(loop: ControlLoop, controller: Controller) -> Response:
    time = np.linspace(0.0, DURATION, 801)
    return loop.replace(controller=controller).simulate(time)


def _settles(response: Response) -> str:
    """Whether and when a response settles, in words that follow "a step"."""
    info = response.info()
    if np.isfinite(info["settling_time"]):
        return (
            f"settles to 2 % in {info['settling_time']:.1f} s with {info['overshoot']:.0f} % "
            "overshoot"
        )
    amplitude = float(np.ptp(response.outputs[response.time > 0.5 * response.time[-1]]))
    return f"still oscillates by {amplitude:.2g} after {response.time[-1]:g} s"
