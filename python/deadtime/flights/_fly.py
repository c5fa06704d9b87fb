"""`fly_axes`: fly under P control, estimate the delays, design PV gains for them, and fly these.

The vehicle takes off and lands once for the flights that are learnt from, and once for those with
designed gains. The link is closed while the gains are designed: that computation takes seconds, in
which the watchdogs of the vehicle are not served, and no vehicle should wait in the air for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, ExitStack
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

from deadtime._base.progress import Stages, stage_report
from deadtime.flights._axis_control import AxisControl
from deadtime.flights._learn import learn
from deadtime.flights._plan import FlightPlan
from deadtime.flights._plants import Shaping
from deadtime.flights._runs import FlownSteps, named
from deadtime.flights._step_test import fly_steps, row_columns
from deadtime.flights._study import FlightStudy
from deadtime.links.axes import AxisReader
from deadtime.links.clock import now
from deadtime.links.journal import Journal
from deadtime.links.vehicle import Echo, Vehicle, VehicleState
from deadtime.loops import PAPER_FILTER, PV, P
from deadtime.recordings import read_recording

#: Flights, and how the vehicle limits the changes of commands by axis.
Flown: TypeAlias = tuple[list[FlownSteps], Mapping[str, Shaping | None]]

Run: TypeAlias = Callable[[Coroutine[Any, Any, Flown]], Flown]

Connect: TypeAlias = Callable[[], AbstractAsyncContextManager[Vehicle]]


class PlannedFlight(NamedTuple):
    """One flight: its plan, its controller, and the time on each step, s."""

    plan: FlightPlan
    controller: P | PV
    hold: float


@runtime_checkable
class PassesMessages(Protocol):
    """A vehicle that passes on every message, not only the newest."""

    def listen(self, listener: Callable[[VehicleState], None] | None) -> None:
        """Register `listener` for every message; None removes it."""


@runtime_checkable
class PassesEchoes(Protocol):
    """A vehicle that passes on every echo of a command, in messages of their own."""

    def listen_to_echoes(self, listener: Callable[[Echo], None] | None) -> None:
        """Register `listener` for every echo; None removes it."""


@runtime_checkable
class ShapesCommands(Protocol):
    """A vehicle that knows how it limits the changes of its commands."""

    async def shaping(self, axis: str) -> tuple[float, float | None] | None:
        """Largest rate of change of a command, and largest rate of that where it has one."""


def fly_experiment(
    connect: Connect,
    plan: FlightPlan,
    folder: Path,
    progress: Stages = False,
    run: Run = asyncio.run,
    warn: Callable[[str], None] = lambda warning: None,
) -> FlightStudy:
    """Fly the plan of one axis: the given gains, then gains designed for the estimated delay.

    Parameters, errors and what is done are those of `fly_axes`.

    Returns
    -------
    FlightStudy
    """
    (study,) = fly_axes(connect, [plan], folder, progress, run, warn)
    return study


def fly_axes(
    connect: Connect,
    plans: Sequence[FlightPlan],
    folder: Path,
    progress: Stages = False,
    run: Run = asyncio.run,
    warn: Callable[[str], None] = lambda warning: None,
) -> list[FlightStudy]:
    """Fly the plans of several axes: given gains, then gains designed for the estimated delays.

    The vehicle takes off twice: for all flights with given gains, and for all with designed ones.
    While one axis is stepped, the vehicle holds the others.

    Parameters
    ----------
    connect : callable
        Returns an asynchronous context manager whose value is a connected vehicle, and that lands
        it on exit.
    plans : sequence of FlightPlan
        One for each axis.
    folder : Path
        Folder for the recordings, which are written during the flights.
    progress : bool or callable
        Called with the name of each stage as it begins, or True to print the names on stderr: one
        for each flight, and two for each axis between.
    run : callable
        Runs a coroutine to its end: `asyncio.run`, or `deadtime.links.run` in virtual time. It is
        called once before the design and once after it.
    warn : callable
        Called with a warning before the designed gains are flown, if the fit on which they are
        based is an indication.

    Returns
    -------
    list of FlightStudy
        One for each plan.

    Raises
    ------
    ValueError
        If a plan is not safe, the vehicle does not have its axis, or no gains meet its margin.
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
    names = [plan.axis for plan in plans]
    if not names or len(set(names)) < len(names):
        raise ValueError(
            f"axes={', '.join(names) or 'none'}: give one or more axes, and each only once"
        )
    for plan in plans:
        plan.check()
    _check_folder(folder)
    tried = [PlannedFlight(plan, P(Kp), plan.hold) for plan in plans for Kp in plan.gains]
    total = sum(plan.flights for plan in plans)
    flown, shaping = run(fly_all(connect, tried, folder, 1, total, report))
    learned = []
    for plan in plans:
        report(f"estimating the delay of {plan.axis}")
        mine = [flight for flight in flown if flight.axis.name == plan.axis]
        learned.append(learn(mine, plan, shaping.get(plan.axis), report))
    # The best P first: if it does not perform as designed, PV should not be tried.
    designed = [
        PlannedFlight(plan, controller, plan.checked_hold)
        for plan, result in zip(plans, learned, strict=True)
        for controller in (
            found.loop.controller for found in (result.proportional, result.designed)
        )
        if isinstance(controller, (P, PV))
    ]
    for plan, result in zip(plans, learned, strict=True):
        for warning in result.warnings():
            warn(f"{plan.axis}: {warning}" if len(plans) > 1 else warning)
    checked, _ = run(fly_all(connect, designed, folder, len(flown) + 1, total, report))
    return [
        FlightStudy(plan, result, tuple(c for c in checked if c.axis.name == plan.axis))
        for plan, result in zip(plans, learned, strict=True)
    ]


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
    flights: Sequence[PlannedFlight],
    folder: Path,
    number: int = 1,
    total: int = 0,
    progress: Callable[[str], object] = lambda stage: None,
) -> Flown:
    """Take off, make all flights one after the other, and land; `number` is that of the first."""
    made = []
    # Before the take-off: what is needed for it may have to be loaded first.
    controls = [_control(flight) for flight in flights]
    shaping: dict[str, Shaping | None] = {}
    axes = tuple(dict.fromkeys(flight.plan.axis for flight in flights))
    # The journals are closed last, so that a slow disk does not keep the vehicle in the air.
    with ExitStack() as journals:
        async with connect() as vehicle:
            _check_axes(vehicle, axes)
            if isinstance(vehicle, ShapesCommands):
                shaping = {axis: await vehicle.shaping(axis) for axis in axes}
            await vehicle.take_off()
            origin = await vehicle.state()
            for place, (flight, control) in enumerate(zip(flights, controls, strict=True), number):
                name = f"{flight.plan.axis} {named(flight.controller)}"
                progress(f"flight {place} of {total or len(flights)}: {name}")
                kind = type(flight.controller).__name__
                path = folder / f"flight-{place}-{flight.plan.axis}-{kind}.csv"
                messages = await _fly_one(vehicle, flight, control, path, journals, origin)
                made.append((flight, path, messages))
            await vehicle.land()
    return [_read(flight, path, messages) for flight, path, messages in made], shaping


def _control(flight: PlannedFlight) -> AxisControl:
    smoothing = getattr(flight.controller, "filter", None) or PAPER_FILTER
    return AxisControl(flight.controller, flight.plan.sample_time, smoothing)


def _check_axes(vehicle: Vehicle, axes: Sequence[str]) -> None:
    missing = [axis for axis in axes if axis not in vehicle.axes]
    if missing:
        raise ValueError(
            f"the vehicle accepts no speed commands on the axis {', '.join(missing)}, only on "
            f"{', '.join(vehicle.axes)}"
        )


def _read(flight: PlannedFlight, path: Path, messages: Path | None) -> FlownSteps:
    """The flight, read back from its file."""
    axis = flight.plan.flown_axis
    recording = read_recording(
        path,
        time="time_s",
        reference=f"reference_{axis.unit}",
        output=axis.columns[0],
        command=f"command_{axis.unit}_s",
    )
    plan = flight.plan
    return FlownSteps(
        flight.controller, recording, path, messages, plan.sample_time, plan.settle, axis
    )


async def _fly_one(
    vehicle: Vehicle,
    flight: PlannedFlight,
    control: AxisControl,
    path: Path,
    journals: ExitStack,
    origin: VehicleState,
) -> Path | None:
    """Make one flight with a vehicle in the air; return the file of its messages, if any."""
    plan, axis = flight.plan, flight.plan.flown_axis
    begin = now()
    journal = journals.enter_context(Journal(path, row_columns(axis)))
    messages = None
    if isinstance(vehicle, PassesMessages):
        messages = path.with_suffix(".messages.csv")
        columns = ("time_s", "vehicle_time_s", "setpoint_time_s", "sequence", *axis.columns)
        saved = journals.enter_context(Journal(messages, columns))
        _keep_messages(vehicle, AxisReader(axis, origin), saved, begin)
    try:
        programme = plan.programme(flight.hold)
        await fly_steps(vehicle, axis, control, programme, plan.limits, journal, begin, origin)
    finally:
        if isinstance(vehicle, PassesMessages):
            vehicle.listen(None)
        if isinstance(vehicle, PassesEchoes):
            vehicle.listen_to_echoes(None)
    return messages


def _keep_messages(
    vehicle: PassesMessages, reader: AxisReader, journal: Journal, begin: float
) -> None:
    """Save every further message, and the echoes of commands with the times of their stamps."""
    has_echoes = isinstance(vehicle, PassesEchoes)

    def save(state: VehicleState) -> None:
        axis = reader.output(state), reader.rate(state), reader.setpoint(state)
        stamps = state.vehicle_time, None if has_echoes else state.vehicle_time
        journal.write((state.time - begin, *stamps, state.sequence, *axis))

    def save_echo(echo: Echo) -> None:
        setpoint = getattr(echo, reader.axis.command, None)
        journal.write((echo.time - begin, None, echo.vehicle_time, None, None, None, setpoint))

    vehicle.listen(save)
    if isinstance(vehicle, PassesEchoes):
        vehicle.listen_to_echoes(save_echo)
