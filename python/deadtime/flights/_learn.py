"""Estimate the delay and its parts from flights under P control, and design gains for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from deadtime._base.errors import NotIdentifiableError
from deadtime._base.verdicts import Verdict, rough
from deadtime.estimation import DelayEstimate, estimate_delay
from deadtime.flights._plan import FlightPlan
from deadtime.flights._plants import (
    Shaping,
    TriedPlant,
    fit_by_evidence,
    for_small_commands,
    lag_of_limits,
)
from deadtime.flights._runs import FlownSteps, read_columns, read_telemetry
from deadtime.flights._split import DelaySplit, split_delay
from deadtime.loops import PAPER_FILTER, PV, ControlLoop, Integrator, P
from deadtime.tuning import Design, design


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
        Delay, gain and lag of all flights together, from the commands as they were sent and the
        outputs as they were measured.
    tried : tuple of TriedPlant
        The plants that were fitted; `fit` is that of one of them.
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
    tried: tuple[TriedPlant, ...]
    split: DelaySplit | None
    unsplit: str
    designed: Design
    proportional: Design

    @property
    def irregular(self) -> tuple[str, ...]:
        """Why the times of the flights are not to be relied on; empty where they are."""
        found = [f"{run.name}: {run.irregular}" for run in self.flights if run.irregular]
        return tuple(found)

    @property
    def verdict(self) -> Verdict:
        """That on the fit; an indication where times are irregular or the parts do not add up."""
        doubted = self.irregular or not self.adds_up
        return "indication" if doubted else self.fit.verdict

    @property
    def adds_up(self) -> bool:
        """Whether link and vehicle together take what the loop does, within their intervals."""
        return self.split is None or self.split.adds_up(self.fit, self.whole_delay)

    @property
    def whole_delay(self) -> float:
        """Delay and lags of the loop for small commands, s: with the lag of the vehicle's limits.

        Where the fitted plant limits acceleration and jerk, `fit` has the delay and the lag beside
        these limits, and small commands are followed with the further lag acceleration/jerk.
        """
        return self.fit.delay_plus_lag + lag_of_limits(self.fit)

    def warnings(self) -> list[str]:
        """Warnings about the gains if the fit does not explain the flights."""
        found = []
        if self.irregular:
            found.append(
                "The times between samples were irregular in flight "
                f"({'; '.join(self.irregular)}), so the estimate is only an indication. Repeat "
                "the experiment on a computer without other work."
            )
        if self.split is not None and not self.adds_up:
            parts = self.split.transport.delay + self.split.vehicle_delay
            found.append(
                f"By the vehicle's reports, link and vehicle together take {rough(parts, 's')}. "
                f"By the fit to command and output, they take {rough(self.whole_delay, 's')}. "
                "The difference is larger than their intervals allow, so the estimate is only "
                "an indication."
            )
        if self.fit.verdict != "reliable":
            found.append(
                "The estimate is only an indication, because the fit does not explain the "
                f"flights ({self.fit.reason}). The cause may be wind, or a plant of another "
                "kind. The gains were designed for intervals that may be too narrow, so their "
                "margins are not certain. Fly these gains only with free space around the "
                "vehicle, and repeat the experiment without wind."
            )
        return found


def learn(
    flights: Sequence[FlownSteps],
    plan: FlightPlan,
    shaping: Shaping | None = None,
    progress: Callable[[str], object] = lambda stage: None,
) -> Learned:
    """Estimate the delay from flights under P control, and design gains for it.

    Parameters
    ----------
    flights : sequence of FlownSteps
        Of one axis of one vehicle, each under a P controller.
    plan : FlightPlan
        Limit of the commands, size of the steps and gain margin of the designed gains.
    shaping : (float, float or None), optional
        Largest rate of change of the vehicle's command and of that, where it tells them.
    progress : callable
        Called with the name of each further stage.

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
    largest = plan.limits.largest(plan.flown_axis)
    known = [
        ControlLoop(Integrator(), run.controller, sample_time=run.sample_time, limit=largest)
        for run in flights
    ]
    overshoot = tuple(_by_overshoot(run, loop) for run, loop in zip(flights, known, strict=True))
    fit, tried = fit_by_evidence(flights, largest, shaping, progress)
    split, unsplit = _split(flights)
    progress(f"designing for the delay of {plan.axis}")
    # Where the vehicle reports its rate, no filter is needed.
    reported = _reports_rate(flights[0])
    template = PV(1.0, 0.1) if reported else PV(1.0, 0.1, PAPER_FILTER)
    designed, proportional = (
        design(
            for_small_commands(fit),
            controller=controller,
            objective="settling_time",
            gain_margin=plan.gain_margin,
            amplitude=plan.step,
            allow_indication=True,
        )
        for controller in (template, P(1.0))
    )
    return Learned(tuple(flights), overshoot, fit, tried, split, unsplit, designed, proportional)


def _reports_rate(flight: FlownSteps) -> bool:
    """Whether the vehicle reported the rate of the axis with every sample."""
    rates = read_columns(flight.path, ("time_s", flight.axis.columns[1]))
    return bool(rates.shape[1] == len(flight.recording))


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
    read = [read_telemetry(flight) for flight in flights]
    messages = [telemetry for telemetry in read if telemetry is not None]
    if not messages or len(messages) < len(flights):
        return None, "the vehicle does not report its setpoint and its speed"
    try:
        return split_delay(messages), ""
    except NotIdentifiableError as refusal:
        return None, str(refusal)
