"""What flights under P control tell: the delay, its parts, and gains for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation import DelayEstimate, estimate_delay
from deadtime.flights._runs import FlownSteps, read_telemetry
from deadtime.flights._split import DelaySplit, split_delay
from deadtime.loops import PV, ControlLoop, Integrator, P
from deadtime.loops._derivative_filter import PAPER_FILTER
from deadtime.tuning import Design, design

__all__ = ["COLUMNS", "FlightStudy", "Learned", "learn"]

#: Heads of the columns that `FlightStudy.rows` fills.
COLUMNS = (
    "flight",
    "overshoot / %",
    "settled / s",
    "paper's delay / s",
    "period / ms",
    "missed",
)


@dataclass(frozen=True)
class Learned:
    """What was learnt from flights under P control.

    Attributes
    ----------
    flights : tuple of FlownSteps
        The flights.
    overshoot : tuple of DelayEstimate or str
        The delay of each by the paper's overshoot method, or why it has none.
    fit : DelayEstimate
        Delay, gain and lag of all flights together, from the commands as they were sent.
    split : DelaySplit or None
        Transport and the vehicle's own part, if the vehicle tells what that takes.
    unsplit : str
        Why there is no `split`; empty where there is one.
    designed : Design
        PV gains for the interval of the delay.
    proportional : Design
        The best P gain under the same demands.
    """

    flights: tuple[FlownSteps, ...]
    overshoot: tuple[DelayEstimate | str, ...]
    fit: DelayEstimate
    split: DelaySplit | None
    unsplit: str
    designed: Design
    proportional: Design

    def doubts(self) -> list[str]:
        """What is to be said of the gains if the fit does not explain the flights."""
        if self.fit.adequate:
            return []
        return [
            "The fit is not adequate (adequate=False): what it leaves of the flights is more than "
            "noise of the sensor, for example wind. Its intervals are an indication, and may be "
            "too narrow; the gains were designed for them, so their margin is not assured. Fly "
            "such gains with room around, and learn again in still air."
        ]


@dataclass(frozen=True)
class FlightStudy:
    """The whole experiment.

    Attributes
    ----------
    step : float
        m.
    max_climb : float
        m/s.
    learned : Learned
        What the first flights told.
    checked : tuple of FlownSteps
        The flights of what was designed: the best P, then PV.
    """

    step: float
    max_climb: float
    learned: Learned
    checked: tuple[FlownSteps, ...]

    @property
    def before(self) -> FlownSteps:
        """The liveliest of the flights that were learnt from."""
        return max(self.learned.flights, key=lambda one: one.controller.gains["Kp"])

    @property
    def after(self) -> FlownSteps:
        """The flight under the PV gains."""
        return self.checked[-1]

    @property
    def flights(self) -> tuple[FlownSteps, ...]:
        """All of them, in the order they were flown in."""
        return (*self.learned.flights, *self.checked)

    def verdict(self) -> str:
        """The outcome in a few sentences."""
        fit = self.learned.fit
        low, high = fit.ci(0.95, "delay+lag")
        said = [
            f"The loop is {fit.delay_plus_lag:.3f} s late, between {low:.3f} and {high:.3f} s with "
            f"95 % confidence: a delay of {fit.delay:.3f} s and a lag of {fit.lag or 0.0:.3f} s, "
            f"at a gain of {fit.gain or 0.0:.3f}."
        ]
        split = self.learned.split
        if split is not None:
            said.append(
                f"By the vehicle's own word the link takes {split.transport.delay:.3f} s of it and "
                f"the vehicle {split.vehicle_lateness:.3f} s."
            )
        before, after = self.before, self.after
        said.append(
            f"A step {_did(before)} under {before.name}, and {_did(after)} under {after.name}."
        )
        said += self.learned.doubts()
        return " ".join(said)

    def rows(self) -> list[tuple[str, ...]]:
        """A line for each flight, under the heads `COLUMNS`."""
        found: list[tuple[str, ...]] = []
        methods = [*self.learned.overshoot, *([""] * len(self.checked))]
        for flight, paper in zip(self.flights, methods, strict=True):
            delay = paper if isinstance(paper, str) else f"{paper.delay:.3f}"
            settled = flight.settling_time
            timing = flight.timing
            found.append(
                (
                    flight.name,
                    f"{flight.overshoot:.1f}",
                    f"{settled:.2f}" if np.isfinite(settled) else "not",
                    delay if len(delay) < 8 else "none",
                    f"{1e3 * timing.period:.1f} ± {1e3 * timing.jitter:.1f}",
                    f"{timing.missed}",
                )
            )
        return found

    def parts(self) -> list[tuple[str, ...]]:
        """What the delay consists of: a name, a value and a 95 % interval, s, for each line."""
        fit, split = self.learned.fit, self.learned.split
        lines: list[tuple[str, ...]] = [
            _part(fit, "delay", "delay, from command and height"),
            _part(fit, "lag", "lag, from command and height"),
            _part(fit, "delay+lag", "together"),
        ]
        if split is not None:
            lines.append(_part(split.transport, "delay", "link, from the demand it echoes"))
            late = "delay+time_constant" if "delay" in split.vehicle.free else "time_constant"
            lines.append(_part(split.vehicle, late, "vehicle, from demand to climb"))
        return lines

    def to_dict(self) -> dict[str, Any]:
        """Everything but the recordings, as plain values for JSON."""
        learned = self.learned
        split = learned.split
        return {
            "verdict": self.verdict(),
            "fit": learned.fit.to_dict(),
            "overshoot_method": [
                one if isinstance(one, str) else one.delay for one in learned.overshoot
            ],
            "transport": None if split is None else split.transport.to_dict(),
            "vehicle": None if split is None else split.vehicle.to_dict(),
            "vehicle_lateness": None if split is None else split.vehicle_lateness,
            "no_split_because": learned.unsplit,
            "designed": learned.designed.gains,
            "designed_p": learned.proportional.gains,
            "flights": [
                {
                    "controller": flight.name,
                    "overshoot": flight.overshoot,
                    "settling_time": flight.settling_time,
                    "recording": flight.path,
                    "period": flight.timing.period,
                    "jitter": flight.timing.jitter,
                    "longest_period": flight.timing.longest,
                    "missed": flight.timing.missed,
                }
                for flight in self.flights
            ],
        }


def _part(fit: DelayEstimate, name: str, words: str) -> tuple[str, str, str]:
    low, high = fit.ci(0.95, name)
    known = {**fit.loop.parameters}
    value = sum(known[part] for part in name.split("+"))
    return words, f"{value:.3f}", f"{low:.3f} to {high:.3f}"


def _did(flight: FlownSteps) -> str:
    settled = flight.settling_time
    when = f"settled in {settled:.1f} s" if np.isfinite(settled) else "did not settle"
    return f"{when} with {flight.overshoot:.0f} % overshoot"


def learn(
    flights: Sequence[FlownSteps],
    max_climb: float,
    step: float,
    gain_margin: float,
    progress: Callable[[str], None] = lambda stage: None,
) -> Learned:
    """Estimate the delay from flights under P control, and design gains for its interval.

    Parameters
    ----------
    flights : sequence of FlownSteps
        Of one vehicle, each under a P controller.
    max_climb : float
        What commands were limited to, m/s.
    step : float
        Size of the steps that the gains are to be good for, m.
    gain_margin : float
        Least gain margin over the intervals of delay and gain.
    progress : callable
        Called with the name of the stage as designing begins.

    Returns
    -------
    Learned

    Raises
    ------
    NotIdentifiableError
        If the flights do not tell the delay.
    ValueError
        If no gains meet the margin.
    """
    known = [
        ControlLoop(Integrator(), one.controller, sample_time=one.sample_time, limit=max_climb)
        for one in flights
    ]
    overshoot = tuple(_by_overshoot(one, loop) for one, loop in zip(flights, known, strict=True))
    # From the middle of the rest before the first step: taking off is over, and what was
    # commanded until then is known.
    fit = estimate_delay(
        [one.recording for one in flights],
        known,
        method="output_error",
        free=("delay", "gain", "lag"),
        window=[(0.5 * one.settle, None) for one in flights],
    )
    split, unsplit = _split(flights)
    progress("designing for the delay")
    reported = split is not None
    template = PV(1.0, 0.1) if reported else PV(1.0, 0.1, PAPER_FILTER)
    designed, proportional = (
        design(
            fit.loop,
            controller=controller,
            delay=fit.ci(0.95, "delay"),
            gain=fit.ci(0.95, "gain"),
            objective="settling_time",
            gain_margin=gain_margin,
            amplitude=step,
        )
        for controller in (template, P(1.0))
    )
    return Learned(tuple(flights), overshoot, fit, split, unsplit, designed, proportional)


def _by_overshoot(flight: FlownSteps, loop: ControlLoop) -> DelayEstimate | str:
    try:
        return estimate_delay(
            flight.recording,
            loop,
            method="overshoot",
            free=("delay",),
            window=flight.first_step(),
        )
    except NotIdentifiableError as refusal:
        return str(refusal)


def _split(flights: Sequence[FlownSteps]) -> tuple[DelaySplit | None, str]:
    """The parts of the delay, or why they are not known."""
    told = [
        read_telemetry(one.telemetry, one.recording) for one in flights if one.telemetry is not None
    ]
    messages = [one for one in told if one is not None]
    if not messages or len(messages) < len(flights):
        return None, "the vehicle does not tell what demand it follows and how fast it climbs"
    try:
        return split_delay(messages), ""
    except NotIdentifiableError as refusal:
        return None, str(refusal)
