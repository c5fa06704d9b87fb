"""Flights under robust gains and under gains that follow the delay, after an experiment."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from deadtime._base.errors import NotProvedError
from deadtime._base.validation import positive
from deadtime.estimation import OnlineEstimator
from deadtime.flights._adaptive_control import (
    CHOICE,
    AdaptiveControl,
    ChosenSet,
    ScheduledControl,
)
from deadtime.flights._axis_control import AxisControl
from deadtime.flights._fly import Connect
from deadtime.flights._moving_delay import MovingDelay
from deadtime.flights._plan import FlightPlan
from deadtime.flights._plants import for_small_commands
from deadtime.flights._runs import measures_of, settled
from deadtime.flights._step_test import StepProgramme, fly_steps, row_columns
from deadtime.flights._study import FlightStudy
from deadtime.links.clock import now
from deadtime.links.journal import Journal
from deadtime.loops import (
    PAPER_FILTER,
    PV,
    ControlLoop,
    DerivativeFilter,
    Integrator,
    P,
    RateLimited,
    steady_lag,
)
from deadtime.recordings import Recording, read_recording
from deadtime.tuning import GainSchedule, adaptive_gains

#: Shortest lag that is a state of the plant, s: a shorter one is part of the delay.
LEAST_LAG = 0.02

#: By how much the range of the estimator is longer than that of the gains, s; how much the delay
#: wanders, s/√s; and the level of its intervals.
BEYOND, DRIFT, LEVEL = 0.1, 0.01, 0.999

#: The proof is for steps that are larger than those flown by this factor.
SPARE = 2.0


#: Headings of the columns of `AdaptiveStudy.rows`.
STEP_COLUMNS = (
    "step at / s",
    "robust gains: overshoot / %",
    "settled / s",
    "gains that follow the delay: overshoot / %",
    "settled / s",
    "delay at the step / s",
    "gains for delays up to / s",
)


@dataclass(frozen=True)
class AdaptivePlan:
    """What is flown with gains that follow the delay.

    Attributes
    ----------
    longest : float
        Longest delay for which gains are proved, s.
    duration : float
        Time under control in each of the two flights, s.
    hold : float
        Time on each step, s.
    """

    longest: float = 0.6
    duration: float = 150.0
    hold: float = 8.0

    def programme(self, plan: FlightPlan) -> StepProgramme:
        """Steps up and down in turn."""
        count = round(positive("duration", self.duration) / positive("hold", self.hold))
        references = tuple(plan.base + plan.step * (k % 2) for k in range(max(2, count)))
        return StepProgramme(references, (self.hold,) * len(references), plan.sample_time)


@dataclass(frozen=True)
class AdaptiveStudy:
    """The flight under the robust gains, and the one with gains that follow the delay.

    Attributes
    ----------
    schedule : GainSchedule
        The proved gains.
    robust, adaptive : Recording
        The flights.
    choices : tuple of ChosenSet
        What was known and used at each sample of the second.
    """

    schedule: GainSchedule
    robust: Recording
    adaptive: Recording
    choices: tuple[ChosenSet, ...]

    @property
    def errors(self) -> tuple[float, float]:
        """Mean absolute errors of the two flights."""
        flights = (self.robust, self.adaptive)
        first, second = (float(np.mean(np.abs(run.reference - run.output))) for run in flights)
        return first, second

    @property
    def shares(self) -> tuple[float, ...]:
        """Share of the samples in each set."""
        numbers = np.array([choice.number for choice in self.choices])
        return tuple(float(np.mean(numbers == i)) for i in range(len(self.schedule.sets)))

    def lines(self) -> list[str]:
        """The outcome in a few lines."""
        robust, adaptive = self.errors
        used = ", ".join(
            f"{100.0 * share:.0f} % in the set for delays up to {gain_set.delays[1]:.3g} s"
            for gain_set, share in zip(self.schedule.sets, self.shares, strict=True)
        )
        return [
            *self.schedule.summary().splitlines(),
            f"mean absolute error in thousandths: {1e3 * robust:.1f} with the robust gains, "
            f"{1e3 * adaptive:.1f} with gains that follow the delay",
            f"share of the time: {used}",
        ]

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each step, with the headings `STEP_COLUMNS`."""
        times = np.array([chosen_set.time - self.choices[0].time for chosen_set in self.choices])
        found: list[tuple[str, ...]] = []
        for fixed, other in zip(measures_of(self.robust), measures_of(self.adaptive), strict=False):
            place = int(np.searchsorted(times, other.step.time, side="right")) - 1
            choice = self.choices[max(0, place)]
            found.append(
                (
                    f"{fixed.step.time:.0f}",
                    f"{fixed.overshoot:.1f}",
                    settled(fixed.settling_time),
                    f"{other.overshoot:.1f}",
                    settled(other.settling_time),
                    f"{choice.low:.2f} to {choice.high:.2f}",
                    f"{self.schedule.sets[choice.number].delays[1]:.2f}",
                )
            )
        return found

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "sets": [
                {"gains": dict(gain_set.gains), "delays": list(gain_set.delays), "share": share}
                for gain_set, share in zip(self.schedule.sets, self.shares, strict=True)
            ],
            "proved_step": self.schedule.proof.step,
            "error_robust": self.errors[0],
            "error_adaptive": self.errors[1],
        }


def schedule_of(
    study: FlightStudy, adapt: AdaptivePlan, report: Callable[[str], object]
) -> GainSchedule:
    """Proved gains for the estimated plant.

    A plant of higher order is taken as an integrator with a lag that is late by as much.
    """
    plan, fit = study.plan, for_small_commands(study.learned.fit)
    num, den = fit.loop.plant.polynomials()
    lag = steady_lag(num.tolist(), den.tolist())
    lag = lag if lag >= LEAST_LAG else 0.0
    gain = float(num[-1] / den[-2])
    plant = Integrator(gain, lag=lag)
    controller: P | PV = PV(
        1.0,
        0.1,
        DerivativeFilter(PAPER_FILTER.omega, PAPER_FILTER.damping, discretisation="tustin"),
    )
    reported = getattr(study.learned.designed.loop.controller, "filter", None) is None
    if reported and lag > 0.0:
        controller = PV(1.0, 0.1)
    largest = plan.limits.largest(plan.flown_axis)
    loop = ControlLoop(plant, controller, sample_time=plan.sample_time, limit=largest)
    if fit.delay >= adapt.longest:
        raise NotProvedError(
            f"the delay was estimated as {fit.delay:.3g} s, but --adapt proves gains only up to "
            f"{adapt.longest:g} s: give a longer delay"
        )
    return adaptive_gains(
        loop,
        (0.0, adapt.longest),
        gain=fit.ci(0.95, "gain"),
        step=SPARE * plan.step,
        gain_margin=plan.gain_margin,
        progress=report,
    )


def fly_adaptive(
    connect: Connect,
    study: FlightStudy,
    adapt: AdaptivePlan,
    folder: Path,
    report: Callable[[str], object] = lambda stage: None,
    run: Callable[[Coroutine[Any, Any, Any]], Any] = asyncio.run,
    moving: MovingDelay | None = None,
) -> AdaptiveStudy:
    """Prove gains for the plant of an experiment, and fly them beside the robust ones.

    Parameters
    ----------
    connect, report, run
        As of `fly_experiment`; the vehicle takes off once.
    study : FlightStudy
        The experiment.
    adapt : AdaptivePlan
        What is flown.
    folder : Path
        Folder for the recordings, the choices and the proof.
    moving : MovingDelay, optional
        The delay of the vehicle, told to move in each flight.

    Returns
    -------
    AdaptiveStudy

    Raises
    ------
    NotProvedError
        If no form was found; nothing is flown then.
    FlightAbortedError, LinkError
        As `fly_experiment`.
    """
    schedule = schedule_of(study, adapt, report)
    (folder / f"proof-{study.axis.name}.json").write_text(
        schedule.proof.to_json(indent=1) + "\n", encoding="utf-8"
    )
    controls = _controls(schedule, study, adapt)
    axis = study.axis.name
    paths = [folder / f"flight-{axis}-{name}.csv" for name in ("robust", "adaptive")]
    programme = adapt.programme(study.plan)
    programme.check(study.plan.limits, study.axis)
    run(_flown(connect, study, programme, controls, paths, report, moving))
    robust, adaptive = (_read(path, study) for path in paths)
    choices = tuple(controls[1].choices)
    with Journal(folder / f"choices-{axis}.csv", CHOICE) as journal:
        for row in choices:
            journal.write(
                (row.time - choices[0].time, row.low, row.high, row.number, int(row.covered))
            )
    return AdaptiveStudy(schedule, robust, adaptive, choices)


def _controls(
    schedule: GainSchedule, study: FlightStudy, adapt: AdaptivePlan
) -> tuple[AxisControl, AdaptiveControl]:
    """The control with the robust gains alone, and the one that follows the delay."""
    fit, shaping = study.learned.fit, study.learned.fit.loop.plant
    if isinstance(shaping, RateLimited):
        fit = replace(fit, loop=fit.loop.replace(plant=shaping.plant))
    estimator = OnlineEstimator.from_estimate(
        fit, delays=(0.0, adapt.longest + BEYOND), drift=DRIFT, level=LEVEL
    )
    largest = study.plan.limits.largest(study.axis)
    limits = shaping if isinstance(shaping, RateLimited) else None
    following = AdaptiveControl(schedule, estimator, largest, limits)
    return ScheduledControl(schedule), following


async def _flown(
    connect: Connect,
    study: FlightStudy,
    programme: StepProgramme,
    controls: tuple[AxisControl, AdaptiveControl],
    paths: list[Path],
    report: Callable[[str], object],
    moving: MovingDelay | None,
) -> None:
    axis, plan = study.axis, study.plan
    with ExitStack() as journals:
        async with connect() as vehicle:
            await vehicle.take_off()
            origin = await vehicle.state()
            names = ("the robust gains", "gains that follow the delay")
            for name, control, path in zip(names, controls, paths, strict=True):
                report(f"flight under {name}")
                begin = now()
                if moving is not None:
                    moving.start(begin, programme.duration)
                journal = journals.enter_context(Journal(path, row_columns(axis)))
                await fly_steps(
                    vehicle, axis, control, programme, plan.limits, journal, begin, origin
                )
            await vehicle.land()


def _read(path: Path, study: FlightStudy) -> Recording:
    axis = study.axis
    return read_recording(
        path,
        time="time_s",
        reference=f"reference_{axis.unit}",
        output=axis.columns[0],
        command=f"command_{axis.unit}_s",
    )
