"""`fly_experiment`: fly under P control, estimate the delay, design PV gains for it, and fly these.

The vehicle takes off and lands once for each flight. The link is closed while the gains are
designed: that computation takes seconds, in which the watchdogs of the vehicle are not served, and
no vehicle should wait in the air for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from contextlib import AbstractAsyncContextManager, ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Protocol, TypeAlias, runtime_checkable

from deadtime._base.progress import Stages, stage_report
from deadtime._base.validation import positive
from deadtime.flights._height_control import HeightControl
from deadtime.flights._learn import FlightStudy, learn
from deadtime.flights._runs import FlownSteps, named
from deadtime.flights._step_test import ROW, StepProgramme, check_gain, fly_steps
from deadtime.links.clock import now
from deadtime.links.journal import Journal
from deadtime.links.safety import Limits
from deadtime.links.vehicle import Vehicle, VehicleState
from deadtime.loops import PV, P
from deadtime.loops._derivative_filter import PAPER_FILTER
from deadtime.recordings import read_recording

Connect: TypeAlias = Callable[[], AbstractAsyncContextManager[Vehicle]]

#: Columns of a file with every message of the vehicle after its time, and their `VehicleState`.
MESSAGE = {
    "vehicle_time_s": "vehicle_time",
    "sequence": "sequence",
    "height_m": "height",
    "climb_m_s": "climb",
    "climb_setpoint_m_s": "climb_setpoint",
}


#: Smallest step, m: several times the noise of the height.
LEAST_STEP = 0.02


@runtime_checkable
class PassesMessages(Protocol):
    """A vehicle that passes on every message, not only the newest."""

    def listen(self, listener: Callable[[VehicleState], None] | None) -> None:
        """Register `listener` for every message; None removes it."""


@dataclass(frozen=True)
class FlightPlan:
    """The plan of a flight experiment.

    Attributes
    ----------
    gains : tuple of float
        Proportional gains of the first flights, 1/s, one flight each.
    step : float
        Size of the steps, m.
    base : float
        Height before the steps, m.
    settle, hold : float
        Time at the base before the first step, and on each step, s.
    checked_hold : float
        Time on each step of the flights with designed gains, s.
    sample_time : float
        Time between two commands, s.
    limits : Limits
        Limits of every flight.
    prior_delay, prior_gain : float
        Assumed delay (s, lags included) and gain of the vehicle, which bound `gains`.
    gain_margin : float
        Least gain margin of the designed gains.

    Examples
    --------
    >>> FlightPlan().flights
    4
    >>> FlightPlan(gains=(4.0,)).check()
    Traceback (most recent call last):
    ValueError: Kp = 4 is above 2.47, half of the stability limit with a delay of 0.36 s and a gain
    of \
0.885: fly a smaller gain
    """

    gains: tuple[float, ...] = (1.2, 2.4)
    step: float = 0.25
    base: float = 1.0
    settle: float = 5.0
    hold: float = 6.5
    checked_hold: float = 4.5
    sample_time: float = 0.065
    limits: Limits = field(default_factory=lambda: Limits(max_climb=1.0))
    prior_delay: float = 0.36
    prior_gain: float = 0.885
    gain_margin: float = 2.5

    def programme(self, hold: float) -> StepProgramme:
        """The references: at the base, a step up, a step down."""
        heights = (self.base, self.base + self.step, self.base)
        return StepProgramme(heights, (self.settle, hold, hold), self.sample_time)

    @property
    def flights(self) -> int:
        """Number of flights: one for each gain, then the best P, then PV."""
        return len(self.gains) + 2

    @property
    def duration(self) -> float:
        """Time under control in all flights, s, without take-off and landing."""
        learning = len(self.gains) * self.programme(self.hold).duration
        return learning + 2.0 * self.programme(self.checked_hold).duration

    def check(self) -> None:
        """Refuse a plan that is not safe.

        Raises
        ------
        ValueError
            For no gain, a gain that is too large, a step below the noise, or a programme that
            would exceed the limits.
        """
        if not self.gains:
            raise ValueError("no gains to fly: give at least one")
        if positive("step", self.step) < LEAST_STEP:
            raise ValueError(
                f"step={self.step:g} m is within the noise of the height: fly {LEAST_STEP:g} m or "
                "more"
            )
        for Kp in self.gains:
            check_gain(Kp, self.prior_delay, self.prior_gain)
        self.programme(self.hold).check(self.limits)

    def lines(self) -> list[str]:
        """Plan and limits in words, to be shown before a flight."""
        gains = ", ".join(f"{Kp:g}" for Kp in self.gains)
        return [
            f"{self.flights} flights: steps of {self.step:g} m from {self.base:g} m under P "
            f"control with Kp = {gains}, then under gains designed from these",
            *self.limits.lines(),
        ]


def fly_experiment(
    connect: Connect,
    plan: FlightPlan,
    folder: Path,
    progress: Stages = False,
    run: Callable[[Coroutine[Any, Any, list[FlownSteps]]], list[FlownSteps]] = asyncio.run,
    warn: Callable[[str], None] = lambda warning: None,
) -> FlightStudy:
    """Fly a plan: the given gains, then gains designed for the estimated delay.

    Parameters
    ----------
    connect : callable
        Returns an asynchronous context manager whose value is a connected vehicle, and that lands
        it on exit.
    plan : FlightPlan
        The plan.
    folder : Path
        Folder for the recordings, which are written during the flights.
    progress : bool or callable
        Called with the name of each stage as it begins, or True to print the names on stderr: one
        for each flight, and two between.
    run : callable
        Runs a coroutine to its end: `asyncio.run`, or `deadtime.links.run` in virtual time. It is
        called once before the design and once after it.
    warn : callable
        Called with a warning before the designed gains are flown, if the fit on which they are
        based is not adequate.

    Returns
    -------
    FlightStudy

    Raises
    ------
    ValueError
        If the plan is not safe, or no gains meet its margin.
    OSError
        If nothing can be written into the folder.
    FlightAbortedError
        If a safety rule ends a flight. The vehicle is landed, the recordings so far are kept.
    LinkError
        If the link cannot be made or is lost.
    NotIdentifiableError
        If the flights do not determine the delay.
    """
    report = stage_report(progress)
    plan.check()
    _check_folder(folder)
    tried = [P(Kp) for Kp in plan.gains]
    flown = run(fly_all(connect, tried, plan, plan.hold, folder, 1, report))
    report("estimating the delay")
    learned = learn(flown, plan.limits.max_climb, plan.step, plan.gain_margin, report)
    for warning in learned.warnings():
        warn(warning)
    # The best P first: if it does not perform as designed, PV should not be tried.
    controllers = [design.loop.controller for design in (learned.proportional, learned.designed)]
    designed = [one for one in controllers if isinstance(one, (P, PV))]
    hold = plan.checked_hold
    checked = run(fly_all(connect, designed, plan, hold, folder, len(flown) + 1, report))
    return FlightStudy(plan.step, plan.limits.max_climb, learned, tuple(checked))


def _check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be written to, before the first take-off."""
    if not folder.exists():
        folder.mkdir(parents=True)
    try:
        with TemporaryFile(dir=folder) as file:
            file.write(b"room for a row")
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(folder)) from None


async def fly_all(
    connect: Connect,
    controllers: Sequence[P | PV],
    plan: FlightPlan,
    hold: float,
    folder: Path,
    number: int,
    progress: Callable[[str], object] = lambda stage: None,
) -> list[FlownSteps]:
    """Make one flight under each controller over one link; `number` is that of the first."""
    flown = []
    # The journals are closed last, so that a slow disk does not keep the vehicle in the air.
    with ExitStack() as journals:
        async with connect() as vehicle:
            for place, controller in enumerate(controllers, number):
                progress(f"flight {place} of {plan.flights}: {named(controller)}")
                path = folder / f"flight-{place}-{type(controller).__name__}.csv"
                messages = await _fly_one(vehicle, controller, plan, hold, path, journals)
                flown.append((controller, path, messages))
    return [
        FlownSteps(
            controller,
            read_recording(
                path,
                time="time_s",
                reference="reference_m",
                output="height_m",
                command="command_m_s",
            ),
            path,
            messages,
            plan.sample_time,
            plan.settle,
        )
        for controller, path, messages in flown
    ]


async def _fly_one(
    vehicle: Vehicle,
    controller: P | PV,
    plan: FlightPlan,
    hold: float,
    path: Path,
    journals: ExitStack,
) -> Path | None:
    """Make one flight from take-off to landing; return the file of its messages, if any."""
    smoothing = getattr(controller, "filter", None) or PAPER_FILTER
    control = HeightControl(controller, plan.sample_time, smoothing)
    await vehicle.take_off()
    begin = now()
    journal = journals.enter_context(Journal(path, ROW))
    messages = None
    if isinstance(vehicle, PassesMessages):
        messages = path.with_suffix(".messages.csv")
        _keep_messages(
            vehicle, journals.enter_context(Journal(messages, ("time_s", *MESSAGE))), begin
        )
    try:
        await fly_steps(vehicle, control, plan.programme(hold), plan.limits, journal, begin)
    finally:
        if isinstance(vehicle, PassesMessages):
            vehicle.listen(None)
    await vehicle.land()
    return messages


def _keep_messages(vehicle: PassesMessages, journal: Journal, begin: float) -> None:
    """Save every further message."""

    def save(state: VehicleState) -> None:
        reported = (getattr(state, name) for name in MESSAGE.values())
        journal.write((state.time - begin, *reported))

    vehicle.listen(save)
