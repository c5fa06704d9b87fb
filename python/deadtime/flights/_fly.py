"""The paper's experiment from end to end: fly P, learn the delay, design PV for it, fly that.

The vehicle takes off and lands once for each flight. Between learning and checking the link is
closed: what computes for seconds cannot answer a vehicle's watchdogs, and no vehicle waits in the
air for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from contextlib import AbstractAsyncContextManager, ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Protocol, TypeAlias, runtime_checkable

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

__all__ = ["Connect", "FlightPlan", "TellsAll", "fly_all", "fly_experiment"]

Connect: TypeAlias = Callable[[], AbstractAsyncContextManager[Vehicle]]

#: Columns of a file with every message of the vehicle.
MESSAGE = (
    "time_s",
    "vehicle_time_s",
    "sequence",
    "height_m",
    "climb_m_s",
    "climb_demand_m_s",
)


#: Smallest step, m: several times the noise of a height.
LEAST_STEP = 0.02


@runtime_checkable
class TellsAll(Protocol):
    """A vehicle that hands on each of its messages, not only the newest."""

    def listen(self, listener: Callable[[VehicleState], None] | None) -> None:
        """Call `listener` with each message from now on; None: no longer."""


@dataclass(frozen=True)
class FlightPlan:
    """What is to be flown.

    Attributes
    ----------
    gains : tuple of float
        Proportional gains to learn from, 1/s, a flight each.
    step : float
        m.
    base : float
        Height from which the steps go up, m.
    settle, hold : float
        Time at the base before the first step, and on each step, s.
    checked_hold : float
        Time on each step when what was designed is flown, s.
    sample_time : float
        s.
    limits : Limits
        Of every flight.
    prior_delay, prior_gain : float
        What delay (s, lags included) and gain are believed to be: they bound `gains`.
    gain_margin : float
        Least gain margin of what is designed.

    Examples
    --------
    >>> FlightPlan().flights
    4
    >>> FlightPlan(gains=(4.0,)).check()
    Traceback (most recent call last):
    ValueError: Kp = 4 is above 2.47, half of what is stable with a delay of 0.36 s and a gain of \
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
        """At the base, a step up, a step down."""
        heights = (self.base, self.base + self.step, self.base)
        return StepProgramme(heights, (self.settle, hold, hold), self.sample_time)

    @property
    def flights(self) -> int:
        """How many there are: one for each gain, then the best P, then PV."""
        return len(self.gains) + 2

    @property
    def duration(self) -> float:
        """Time under control in all flights, s; taking off and landing come on top."""
        learning = len(self.gains) * self.programme(self.hold).duration
        return learning + 2.0 * self.programme(self.checked_hold).duration

    def check(self) -> None:
        """Refuse a plan that is not safe.

        Raises
        ------
        ValueError
            For no or too large a gain, a step that is too small to be seen, or a programme that
            the limits would end.
        """
        if not self.gains:
            raise ValueError("no gains to fly: give at least one")
        if positive("step", self.step) < LEAST_STEP:
            raise ValueError(
                f"step={self.step:g} m is lost in the noise of a height: fly {LEAST_STEP:g} m or "
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
    progress: Callable[[str], None] = lambda stage: None,
    run: Callable[[Coroutine[Any, Any, list[FlownSteps]]], list[FlownSteps]] = asyncio.run,
    warn: Callable[[str], None] = lambda doubt: None,
) -> FlightStudy:
    """Fly the plan.

    Parameters
    ----------
    connect : callable
        Makes an asynchronous context manager whose value is a connected vehicle, and that lands it.
    plan : FlightPlan
        What to fly.
    folder : Path
        Recordings are saved there as they come.
    progress : callable
        Called with the name of each stage as it begins: one for each flight, and two between.
    run : callable
        Runs a coroutine to its end: `asyncio.run`, or `deadtime.links.run` in virtual time. It is
        called once to learn and once to check.
    warn : callable
        Called with what is to be said of the gains before they are flown, if the fit that they were
        designed from is not adequate.

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
        If the flights do not tell the delay.
    """
    plan.check()
    _check_folder(folder)
    tried = [P(Kp) for Kp in plan.gains]
    flown = run(fly_all(connect, tried, plan, plan.hold, folder, 1, progress))
    progress("estimating the delay")
    learned = learn(flown, plan.limits.max_climb, plan.step, plan.gain_margin, progress)
    for doubt in learned.doubts():
        warn(doubt)
    # The best P first: if it does not fly as it should, PV had better not be tried.
    made = [design.loop.controller for design in (learned.proportional, learned.designed)]
    designed = [one for one in made if isinstance(one, (P, PV))]
    hold = plan.checked_hold
    checked = run(fly_all(connect, designed, plan, hold, folder, len(flown) + 1, progress))
    return FlightStudy(plan.step, plan.limits.max_climb, learned, tuple(checked))


def _check_folder(folder: Path) -> None:
    """Refuse a folder that no file can be made in, before anything is in the air."""
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
    progress: Callable[[str], None] = lambda stage: None,
) -> list[FlownSteps]:
    """One flight under each controller, over one link; `number` is that of the first."""
    flown = []
    # The journals are closed last: however slow the disk is, the vehicle is down by then.
    with ExitStack() as journals:
        async with connect() as vehicle:
            for place, controller in enumerate(controllers, number):
                progress(f"flight {place} of {plan.flights}: {named(controller)}")
                path = folder / f"flight-{place}-{type(controller).__name__}.csv"
                told = await _fly_one(vehicle, controller, plan, hold, path, journals)
                flown.append((controller, path, told))
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
            told,
            plan.sample_time,
            plan.settle,
        )
        for controller, path, told in flown
    ]


async def _fly_one(
    vehicle: Vehicle,
    controller: P | PV,
    plan: FlightPlan,
    hold: float,
    path: Path,
    journals: ExitStack,
) -> Path | None:
    """One flight, from taking off to landing; the file of its messages, if there is one."""
    smoothing = getattr(controller, "filter", None) or PAPER_FILTER
    control = HeightControl(controller, plan.sample_time, smoothing)
    await vehicle.take_off()
    begin = now()
    journal = journals.enter_context(Journal(path, ROW))
    told = None
    if isinstance(vehicle, TellsAll):
        told = path.with_suffix(".messages.csv")
        _keep_messages(vehicle, journals.enter_context(Journal(told, MESSAGE)), begin)
    try:
        await fly_steps(vehicle, control, plan.programme(hold), plan.limits, journal, begin)
    finally:
        if isinstance(vehicle, TellsAll):
            vehicle.listen(None)
    await vehicle.land()
    return told


def _keep_messages(vehicle: TellsAll, journal: Journal, begin: float) -> None:
    """Save every message that comes from now on."""

    def save(state: VehicleState) -> None:
        journal.write(
            (
                state.time - begin,
                state.vehicle_time,
                state.sequence,
                state.height,
                state.climb,
                state.climb_demand,
            )
        )

    vehicle.listen(save)
