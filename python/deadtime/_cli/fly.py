"""``deadtime fly``: the experiment of the paper, with an emulator or a drone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.show import (
    ERRORS,
    as_json_text,
    print_json,
    print_table,
    print_text,
    results_table,
    stages,
)
from deadtime._cli.vehicles import flown_vehicle
from deadtime.flights import FlightPlan, FlightStudy, fly_experiment
from deadtime.flights._learn import COLUMNS
from deadtime.flights._page import PARTS, write_flight_page
from deadtime.links import Limits
from deadtime.links.ardrone2.emulator.motion import PlantName
from deadtime.links.mavlink import LinkAddress

#: Largest commanded climb in m/s: on this computer, as in the paper, and elsewhere: it can hurt.
EMULATED_CLIMB, REAL_CLIMB = 1.0, 0.5

#: Default gains of the first flights: for an AR.Drone, and for ArduPilot and PX4.
GAINS, LINK_GAINS = "1.2,2.4", "0.8,1.4"

#: Assumed delay of ArduPilot and PX4, s, lags included, and their gain.
LINK_PRIOR = (0.5, 1.0)

#: Default folder for recordings.
FOLDER = "flight"


def command(
    host: Annotated[
        str | None,
        typer.Option(
            help="Address of an AR.Drone 2.0. Without --host or --link: an emulator is started.",
            metavar="ADDRESS",
        ),
    ] = None,
    link: Annotated[
        str | None,
        typer.Option(
            help="Vehicle with ArduPilot or PX4: udp:HOST:PORT waits there for it, udpout:HOST:PORT"
            " sends first, tcp:HOST:PORT connects.",
            metavar="KIND:HOST:PORT",
        ),
    ] = None,
    consent: Annotated[
        bool,
        typer.Option(
            "--i-have-a-safe-area",
            help="Needed with --host, and with a --link to another computer or to what is no "
            "simulator: a vehicle is about to take off there.",
        ),
    ] = False,
    plant: Annotated[PlantName, typer.Option(help="What the emulator flies like.")] = "kit",
    gains: Annotated[
        str | None,
        typer.Option(
            help=f"Proportional gains to learn from: {GAINS}, with --link {LINK_GAINS}.",
            show_default=False,
        ),
    ] = None,
    step: Annotated[float, typer.Option(help="Size of the steps, m.")] = 0.25,
    base: Annotated[float, typer.Option(help="Height the steps go up from, m.")] = 1.0,
    max_climb: Annotated[
        float | None,
        typer.Option(
            help=f"Largest vertical speed commanded, m/s: {EMULATED_CLIMB:g} (the paper's) on this "
            f"computer, {REAL_CLIMB:g} elsewhere.",
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
    if host is not None and link is not None:
        raise ValueError("--host is an AR.Drone, --link ArduPilot or PX4: take one")
    elsewhere = host or (None if link is None or LinkAddress.of(link).loopback else link)
    if max_climb is None:
        max_climb = EMULATED_CLIMB if elsewhere is None else REAL_CLIMB
    usual = FlightPlan()
    if gains is None:
        gains = GAINS if link is None else LINK_GAINS
    prior = (usual.prior_delay, usual.prior_gain) if link is None else LINK_PRIOR
    plan = FlightPlan(
        gains=_numbers(gains),
        step=step,
        base=base,
        hold=hold,
        checked_hold=min(hold, usual.checked_hold),
        limits=Limits(max_climb=max_climb, max_height=max_height),
        prior_delay=prior[0],
        prior_gain=prior[1],
    )
    plan.check()
    check_pages()  # needed for the report; fail before anything flies
    if virtual_time and (host is not None or link is not None):
        raise ValueError("--virtual-time is for the emulator, others are in real time: take one")
    if elsewhere is not None:
        _ask_for_consent(elsewhere, plan, consent)
    elif not as_json:
        _print_plan(plan, f"an emulator ({plant})" if link is None else f"the vehicle at {link}")
    where = _free_folder() if folder is None else folder
    if any(where.glob("flight-*.csv")):
        raise ValueError(f"{where} holds recordings already: name another --folder")
    ports = (navdata_port, command_port, control_port)
    try:
        with (
            flown_vehicle(host, link, plant, seed, virtual_time, plan, ports, consent) as vehicle,
            stages(plan.flights + 2, quiet=as_json) as begin,
        ):
            study = fly_experiment(vehicle.connect, plan, where, begin, vehicle.run, _print_note)
    except BaseException as error:
        for note in getattr(error, "__notes__", ()):
            _print_note(note)
        _print_kept_recordings(where)
        raise
    page = where / "report.html"
    trip = vehicle.round_trip()
    result = {
        "flown_on": vehicle.name,
        **study.to_dict(),
        "round_trip": trip,
        "report": page,
        "folder": where,
    }
    text = as_json_text("flight", result)
    (where / "result.json").write_text(text + "\n", encoding="utf-8")
    write_flight_page(study, page, vehicle.name)
    if as_json:
        print_json("flight", result)
    else:
        _print_study(study, page)
        if trip is not None:
            print_text(f"The round trip of the link, by TIMESYNC, was {1e3 * trip:.1f} ms.")


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


def _ask_for_consent(host: str, plan: FlightPlan, consent: bool) -> None:
    _print_plan(plan, f"a drone at {host}")
    if not consent:
        raise ValueError(
            f"nothing was sent to {host}: a drone there would take off {plan.flights} times and "
            "fly as said above. If nobody and nothing can be hurt by it, add --i-have-a-safe-area"
        )


def _print_kept_recordings(folder: Path) -> None:
    kept = sorted(folder.glob("flight-*.csv"))
    if kept:
        print_text(f"kept in {folder}: {', '.join(path.name for path in kept)}", on=ERRORS)


def _print_study(study: FlightStudy, page: Path) -> None:
    print_table(results_table(COLUMNS, study.rows(), "Flights", COLUMNS[:1]))
    print_table(results_table(PARTS, study.parts(), "The delay", PARTS[:1]))
    print_text(study.verdict(), "bold")
    print_text(f"\nRecordings and report are in {page.parent}: {page.name}")
