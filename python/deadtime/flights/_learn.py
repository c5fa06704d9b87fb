"""Estimate the delay and its parts from flights under P control, and design gains for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deadtime._base.digits import between, stated
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation import DelayEstimate, estimate_delay
from deadtime.flights._runs import FlownSteps, read_telemetry
from deadtime.flights._split import DelaySplit, split_delay
from deadtime.loops import PV, ControlLoop, Integrator, P
from deadtime.loops._derivative_filter import PAPER_FILTER
from deadtime.tuning import Design, design

#: Headings of the columns of `FlightStudy.rows`.
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
    """Results of flights under P control: estimates, and gains designed for them.

    Attributes
    ----------
    flights : tuple of FlownSteps
        The flights.
    overshoot : tuple of DelayEstimate or str
        The delay of each by the paper's overshoot method, or the reason why it gives none.
    fit : DelayEstimate
        Delay, gain and lag of all flights together, from the commands as they were sent.
    split : DelaySplit or None
        The parts of the link and of the vehicle, if the vehicle reports what this takes.
    unsplit : str
        Why there is no `split`; empty where there is one.
    designed : Design
        PV gains for the interval of the delay.
    proportional : Design
        The best P gain under the same specifications.
    """

    flights: tuple[FlownSteps, ...]
    overshoot: tuple[DelayEstimate | str, ...]
    fit: DelayEstimate
    split: DelaySplit | None
    unsplit: str
    designed: Design
    proportional: Design

    def warnings(self) -> list[str]:
        """Warnings about the gains if the fit does not explain the flights."""
        if self.fit.adequate:
            return []
        return [
            "The fit is not adequate (adequate=False): its residuals are more than noise of the "
            "sensor, for example wind. Its intervals are an indication and may be too narrow; "
            "the gains were designed for them, so their margin is not assured. Fly such gains "
            "only with space around the vehicle, and repeat the experiment without wind."
        ]


@dataclass(frozen=True)
class FlightStudy:
    """Results of the whole experiment.

    Attributes
    ----------
    step : float
        Size of the steps, m.
    max_climb : float
        Limit of the commands, m/s.
    learned : Learned
        Results of the first flights.
    checked : tuple of FlownSteps
        The flights with designed gains: the best P, then PV.
    """

    step: float
    max_climb: float
    learned: Learned
    checked: tuple[FlownSteps, ...]

    @property
    def before(self) -> FlownSteps:
        """The one of the first flights with the largest gain."""
        return max(self.learned.flights, key=lambda one: one.controller.gains["Kp"])

    @property
    def after(self) -> FlownSteps:
        """The flight under the PV gains."""
        return self.checked[-1]

    @property
    def flights(self) -> tuple[FlownSteps, ...]:
        """All flights, in order of time."""
        return (*self.learned.flights, *self.checked)

    def verdict(self) -> str:
        """The outcome in a few sentences."""
        fit = self.learned.fit
        ends = fit.ci(0.95, "delay+lag")
        whole = fit.stderr["delay+lag"]
        sentences = [
            f"The delay of the loop, lag included, is {stated(fit.delay_plus_lag, whole, 's')}, "
            f"{between(*ends, whole, 's')} with 95 % confidence: a delay of "
            f"{stated(fit.delay, fit.stderr['delay'], 's')} and a lag of "
            f"{stated(fit.lag or 0.0, fit.stderr['lag'], 's')}, at a gain of "
            f"{stated(fit.gain or 0.0, fit.stderr['gain'])}."
        ]
        split = self.learned.split
        if split is not None:
            link = stated(split.transport.delay, split.transport.stderr["delay"], "s")
            own = stated(split.vehicle_delay, split.vehicle.stderr[split.late], "s")
            sentences.append(
                f"According to the vehicle's reports, {link} of it is the link and {own} the "
                "vehicle."
            )
        before, after = self.before, self.after
        sentences.append(
            f"A step {_did(before)} under {before.name}, and {_did(after)} under {after.name}."
        )
        sentences += self.learned.warnings()
        return " ".join(sentences)

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each flight, with the headings `COLUMNS`."""
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
        """The parts of the delay: a name, a value and a 95 % interval for each row."""
        fit, split = self.learned.fit, self.learned.split
        lines: list[tuple[str, ...]] = [
            _part(fit, "delay", "delay, from command and height"),
            _part(fit, "lag", "lag, from command and height"),
            _part(fit, "delay+lag", "together"),
        ]
        if split is not None:
            lines.append(_part(split.transport, "delay", "link, from the setpoint it echoes"))
            lines.append(_part(split.vehicle, split.late, "vehicle, from setpoint to climb"))
        return lines

    def to_dict(self) -> dict[str, Any]:
        """All results but the recordings, as plain values for JSON."""
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
            "vehicle_delay": None if split is None else split.vehicle_delay,
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
    value, error = fit._value(name), fit.stderr[name]
    return words, stated(value, error, "s"), between(*fit.ci(0.95, name), error, "s")


def _did(flight: FlownSteps) -> str:
    settled = flight.settling_time
    when = f"settled in {settled:.1f} s" if np.isfinite(settled) else "did not settle"
    return f"{when} with {flight.overshoot:.0f} % overshoot"


def learn(
    flights: Sequence[FlownSteps],
    max_climb: float,
    step: float,
    gain_margin: float,
    progress: Callable[[str], object] = lambda stage: None,
) -> Learned:
    """Estimate the delay from flights under P control, and design gains for its interval.

    Parameters
    ----------
    flights : sequence of FlownSteps
        Of one vehicle, each under a P controller.
    max_climb : float
        Limit of the commands, m/s.
    step : float
        Size of the steps for which the gains are designed, m.
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
        If the flights do not determine the delay.
    ValueError
        If no gains meet the margin.
    """
    known = [
        ControlLoop(Integrator(), one.controller, sample_time=one.sample_time, limit=max_climb)
        for one in flights
    ]
    overshoot = tuple(_by_overshoot(one, loop) for one, loop in zip(flights, known, strict=True))
    # From the middle of the rest before the first step, where the effect of take-off has decayed
    # and the earlier commands are known.
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
    """The parts of the delay, or the reason why they are unknown."""
    read = [
        read_telemetry(one.telemetry, one.recording) for one in flights if one.telemetry is not None
    ]
    messages = [one for one in read if one is not None]
    if not messages or len(messages) < len(flights):
        return None, "the vehicle does not report which setpoint it follows and how fast it climbs"
    try:
        return split_delay(messages), ""
    except NotIdentifiableError as refusal:
        return None, str(refusal)
