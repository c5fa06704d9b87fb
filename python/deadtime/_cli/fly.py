"""``deadtime fly``: the experiment of the paper, with an emulator or a drone."""

from __future__ import annotations

import itertools
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.landing import run_landing, terminated_like_interrupted
from deadtime._cli.own_emulator import own_emulator
from deadtime._cli.show import (
    ERRORS,
    as_json_text,
    print_json,
    print_table,
    print_text,
    results_table,
    stages,
)
from deadtime.flights import FlightPlan, FlightStudy, FlownSteps, fly_experiment
from deadtime.flights._fly import Connect
from deadtime.flights._learn import COLUMNS
from deadtime.flights._page import PARTS, write_flight_page
from deadtime.links import Limits, Vehicle
from deadtime.links import run as run_virtual
from deadtime.links.ardrone2 import ARDrone2
from deadtime.links.ardrone2.emulator import Emulator, EmulatorOptions
from deadtime.links.ardrone2.emulator.motion import PlantName

#: Largest commanded climb in m/s: on an emulator, as in the paper, and on a drone, which can hurt.
EMULATED_CLIMB, REAL_CLIMB = 1.0, 0.5

#: UDP ports of navdata and commands, TCP port of the control connection.
Ports = tuple[int, int, int]

#: Difference between the noise seeds of successive links. It is large, so that runs with different
#: values of --seed share none.
SEED_STEP = 1_000_003

#: Default folder for recordings.
FOLDER = "flight"


def command(
    host: Annotated[
        str | None,
        typer.Option(
            help="Address of a drone. Without: an emulator is started.", metavar="ADDRESS"
        ),
    ] = None,
    consent: Annotated[
        bool,
        typer.Option(
            "--i-have-a-safe-area", help="Needed with --host: a drone is about to take off there."
        ),
    ] = False,
    plant: Annotated[PlantName, typer.Option(help="What the emulator flies like.")] = "kit",
    gains: Annotated[str, typer.Option(help="Proportional gains to learn from.")] = "1.2,2.4",
    step: Annotated[float, typer.Option(help="Size of the steps, m.")] = 0.25,
    base: Annotated[float, typer.Option(help="Height the steps go up from, m.")] = 1.0,
    max_climb: Annotated[
        float | None,
        typer.Option(
            help=f"Largest vertical speed commanded, m/s: {EMULATED_CLIMB:g} (the paper's) on an "
            f"emulator, {REAL_CLIMB:g} on a drone.",
            show_default=False,
        ),
    ] = None,
    max_height: Annotated[float, typer.Option(help="Height that ends a flight, m.")] = 3.0,
    hold: Annotated[float, typer.Option(help="Time on each step that is learnt from, s.")] = 6.5,
    folder: Annotated[
        Path | None,
        typer.Option(
            help=f"Where recordings and report go. Without: {FOLDER}, {FOLDER}-2, …",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the emulator's noise.")] = 0,
    virtual_time: Annotated[
        bool,
        typer.Option("--virtual-time", help="Emulator and client in one process, in seconds."),
    ] = False,
    navdata_port: Annotated[int, typer.Option(help="Ports of the --host.")] = 5554,
    command_port: Annotated[int, typer.Option()] = 5556,
    control_port: Annotated[int, typer.Option()] = 5559,
    as_json: opt.As_json = False,
) -> None:
    """Fly steps under P control, learn the delay, design PV for it, fly that; land."""
    if max_climb is None:
        max_climb = EMULATED_CLIMB if host is None else REAL_CLIMB
    plan = FlightPlan(
        gains=_numbers(gains),
        step=step,
        base=base,
        hold=hold,
        checked_hold=min(hold, FlightPlan().checked_hold),
        limits=Limits(max_climb=max_climb, max_height=max_height),
    )
    plan.check()
    check_pages()  # needed for the report; fail before anything flies
    if host is not None:
        _ask_for_consent(host, plan, consent, virtual_time)
    elif not as_json:
        _print_plan(plan, f"an emulator ({plant})")
    where = _free_folder() if folder is None else folder
    if any(where.glob("flight-*.csv")):
        raise ValueError(f"{where} holds recordings already: name another --folder")
    ports = (navdata_port, command_port, control_port)
    try:
        with (
            _vehicle(host, plant, seed, virtual_time, plan, ports) as vehicle,
            stages(plan.flights + 2, quiet=as_json) as begin,
        ):
            study = fly_experiment(vehicle.connect, plan, where, begin, vehicle.run, _print_note)
    except BaseException as error:
        for note in getattr(error, "__notes__", ()):
            _print_note(note)
        _print_kept_recordings(where)
        raise
    page = where / "report.html"
    result = {"flown_on": vehicle.name, **study.to_dict(), "report": page, "folder": where}
    text = as_json_text("flight", result)
    (where / "result.json").write_text(text + "\n", encoding="utf-8")
    write_flight_page(study, page, vehicle.name)
    if as_json:
        print_json("flight", result)
    else:
        _print_study(study, page)


def _print_note(sentence: str) -> None:
    print_text(f"deadtime: {sentence}", wrapped=False, on=ERRORS)


def _numbers(gains: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in gains.split(",") if part.strip())
    except ValueError:
        raise ValueError(f"--gains {gains}: give numbers with commas between them") from None


def _free_folder() -> Path:
    number, folder = 1, Path(FOLDER)
    while folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        number += 1
        folder = Path(f"{FOLDER}-{number}")
    return folder


def _print_plan(plan: FlightPlan, vehicle: str) -> None:
    print_text(f"About to fly {vehicle}:", on=ERRORS)
    for line in plan.lines():
        print_text(f"  {line}", wrapped=False, on=ERRORS)


def _ask_for_consent(host: str, plan: FlightPlan, consent: bool, virtual_time: bool) -> None:
    if virtual_time:
        raise ValueError("--virtual-time is for the emulator, --host is in real time: take one")
    _print_plan(plan, f"a drone at {host}")
    if not consent:
        raise ValueError(
            f"nothing was sent to {host}: a drone there would take off {plan.flights} times and "
            "fly as said above. If nobody and nothing can be hurt by it, add --i-have-a-safe-area"
        )


@dataclass(frozen=True)
class _Vehicle:
    """A vehicle: how to connect to it, its name, and what runs it in real or virtual time."""

    connect: Connect
    name: str
    run: Callable[..., list[FlownSteps]]


@contextmanager
def _vehicle(
    host: str | None,
    plant: PlantName,
    seed: int,
    virtual_time: bool,
    plan: FlightPlan,
    ports: Ports,
) -> Iterator[_Vehicle]:
    name = f"an emulated AR.Drone 2.0 ({plant})"
    if virtual_time:
        yield _Vehicle(emulated_drone(plant, seed, plan.limits), name, run_virtual)
    elif host is not None:
        with terminated_like_interrupted():
            yield _Vehicle(lambda: _client(host, plan.limits, ports), host, run_landing)
    else:
        with terminated_like_interrupted(), own_emulator(plant, seed) as own:
            here = EmulatorOptions().host
            yield _Vehicle(lambda: _client(here, plan.limits, own), name, run_landing)


def _client(host: str, limits: Limits, ports: Ports) -> ARDrone2:
    navdata, command, control = ports
    return ARDrone2(host, limits, navdata_port=navdata, command_port=command, control_port=control)


def emulated_drone(plant: PlantName, seed: int, limits: Limits) -> Connect:
    """Connect to an emulator in the same event loop; each link has a different noise seed."""
    seeds = itertools.count(seed, SEED_STEP)

    @asynccontextmanager
    async def connect() -> AsyncIterator[Vehicle]:
        options = EmulatorOptions(
            plant=plant, seed=next(seeds), navdata_port=0, command_port=0, control_port=0
        )
        async with Emulator(options) as emulator:
            ports = (emulator.navdata_port, emulator.command_port, emulator.control_port)
            async with _client(emulator.host, limits, ports) as drone:
                yield drone

    return connect


def _print_kept_recordings(folder: Path) -> None:
    kept = sorted(folder.glob("flight-*.csv"))
    if kept:
        print_text(f"kept in {folder}: {', '.join(path.name for path in kept)}", on=ERRORS)


def _print_study(study: FlightStudy, page: Path) -> None:
    print_table(results_table(COLUMNS, study.rows(), "Flights", COLUMNS[:1]))
    print_table(results_table(PARTS, study.parts(), "The delay", PARTS[:1]))
    print_text(study.verdict(), "bold")
    print_text(f"\nRecordings and report are in {page.parent}: {page.name}")
