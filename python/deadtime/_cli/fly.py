"""``deadtime fly``: the experiment of the paper, with an emulator or a drone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

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
from deadtime.flights import (
    COLUMNS,
    PARTS,
    USUAL,
    AdaptivePlan,
    AdaptiveStudy,
    FlightPlan,
    FlightStudy,
    MovingDelay,
    fly_adaptive,
    fly_axes,
    write_flight_page,
)
from deadtime.links import Limits
from deadtime.links.ardrone2.emulator.motion import PlantName
from deadtime.links.axes import AxisName
from deadtime.links.mavlink import LinkAddress

#: Largest commanded climb in m/s: on this computer, as in the paper, and elsewhere: it can hurt.
EMULATED_CLIMB, REAL_CLIMB = 1.0, 0.5

#: Gains of the first flights on the height of ArduPilot and PX4, 1/s.
LINK_GAINS = (0.8, 1.4)

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
            " sends first, tcp:HOST:PORT connects, serial:DEVICE:BAUD is a serial port. Several"
            " links to it have commas between them.",
            metavar="KIND:HOST:PORT,…",
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
    axes: Annotated[
        str,
        typer.Option(
            help="What is stepped, one after the other: z (height), x (to the north), y (to the "
            "east), yaw (heading). An AR.Drone has z.",
            metavar="AXIS,…",
        ),
    ] = "z",
    gains: Annotated[
        list[str] | None,
        typer.Option(
            help="Proportional gains to learn from; of another axis than z with its name: x=0.5,0.8"
            " (may be repeated).",
            metavar="[AXIS=]K,…",
            show_default=False,
        ),
    ] = None,
    step: Annotated[
        list[str] | None,
        typer.Option(
            help="Size of the steps, m, of yaw rad: 0.25 of z, 0.5 of x and y, 0.4 of yaw; of "
            "another axis than z with its name: x=1 (may be repeated).",
            metavar="[AXIS=]SIZE",
            show_default=False,
        ),
    ] = None,
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
    max_speed: Annotated[
        float, typer.Option(help="Largest horizontal speed commanded, m/s.")
    ] = 0.5,
    max_distance: Annotated[
        float,
        typer.Option(help="Horizontal distance from the take-off that ends a flight, m."),
    ] = 5.0,
    hold: Annotated[float, typer.Option(help="Time on each step that is learnt from, s.")] = 6.5,
    folder: Annotated[
        Path | None,
        typer.Option(
            help=f"Where recordings and report go. Without: {FOLDER}, {FOLDER}-2, …",
            show_default=False,
        ),
    ] = None,
    adapt: Annotated[
        bool,
        typer.Option(
            "--adapt",
            help="Afterwards fly gains that follow the delay beside robust ones, both proved.",
        ),
    ] = False,
    longest_delay: Annotated[
        float, typer.Option(help="Longest delay for which --adapt proves gains, s.")
    ] = AdaptivePlan().longest,
    moving_delay: Annotated[
        str | None,
        typer.Option(
            help="Delay of the emulator's commands in --virtual-time, s: the first one, and the one"
            " that it goes to and back from during --adapt.",
            metavar="FIRST,LONGEST",
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
    here = link is None or all(one.loopback for one in LinkAddress.all_of(link))
    elsewhere = host or (None if here else link)
    if max_climb is None:
        max_climb = EMULATED_CLIMB if elsewhere is None else REAL_CLIMB
    limits = Limits(
        max_climb=max_climb,
        max_height=max_height,
        max_speed=max_speed,
        max_distance=max_distance,
    )
    plans = _plans(axes, gains or [], step or [], base, hold, limits, link is not None)
    for plan in plans:
        plan.check()
    check_pages()  # needed for the report; fail before anything flies
    if virtual_time and (host is not None or link is not None):
        raise ValueError("--virtual-time is for the emulator, others are in real time: take one")
    if moving_delay is not None and not virtual_time:
        raise ValueError("--moving-delay is for the emulator in --virtual-time: add that")
    moving = None if moving_delay is None else MovingDelay(_two_delays(moving_delay))
    adaptive = AdaptivePlan(longest=longest_delay)
    if elsewhere is not None:
        _ask_for_consent(elsewhere, plans, consent)
    elif not as_json:
        _print_plan(plans, f"an emulator ({plant})" if link is None else f"the vehicle at {link}")
    where = _free_folder() if folder is None else folder
    if any(where.glob("flight-*.csv")):
        raise ValueError(f"{where} holds recordings already: name another --folder")
    ports = (navdata_port, command_port, control_port)
    try:
        count = sum(plan.flights for plan in plans) + (6 if adapt else 2) * len(plans)
        with (
            flown_vehicle(
                host, link, plant, seed, virtual_time, base, limits, ports, consent, moving
            ) as vehicle,
            stages(count, quiet=as_json) as begin,
        ):
            studies = fly_axes(vehicle.connect, plans, where, begin, vehicle.run, _print_note)
            adapted: dict[str, AdaptiveStudy] = {
                study.axis.name: fly_adaptive(
                    vehicle.connect, study, adaptive, where, begin, vehicle.run, moving
                )
                for study in studies
                if adapt
            }
    except BaseException as error:
        for note in getattr(error, "__notes__", ()):
            _print_note(note)
        _print_kept_recordings(where)
        raise
    page = where / "report.html"
    trip = vehicle.round_trip()
    result = {
        "flown_on": vehicle.name,
        "axes": {study.axis.name: study.to_dict() for study in studies},
        "adaptive": {name: one.to_dict() for name, one in adapted.items()},
        "round_trip": trip,
        "report": page,
        "folder": where,
    }
    text = as_json_text("flight", result)
    (where / "result.json").write_text(text + "\n", encoding="utf-8")
    write_flight_page(studies, page, vehicle.name, adapted)
    if as_json:
        print_json("flight", result)
    else:
        for study in studies:
            _print_study(study)
            for line in adapted[study.axis.name].lines() if adapt else ():
                print_text(line)
        print_text(f"\nRecordings and report are in {page.parent}: {page.name}")
        if trip is not None:
            print_text(f"The round trip of the link, by TIMESYNC, was {1e3 * trip:.1f} ms.")


def _print_note(sentence: str) -> None:
    print_text(f"deadtime: {sentence}", wrapped=False, on=ERRORS)


def _plans(
    axes: str,
    gains: list[str],
    step: list[str],
    base: float,
    hold: float,
    limits: Limits,
    over_link: bool,
) -> list[FlightPlan]:
    """The plan of each axis."""
    names = [name.strip() for name in axes.split(",") if name.strip()]
    unknown = [name for name in names if name not in USUAL]
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"--axes {axes}: give some of {', '.join(USUAL)}, each once")
    given_gains, given_steps = _by_axis("--gains", gains, names), _by_axis("--step", step, names)
    plans = []
    for name in names:
        changes: dict[str, Any] = {"limits": limits, "hold": hold}
        changes["checked_hold"] = min(hold, FlightPlan().checked_hold)
        if name == "z":
            changes["base"] = base
            if over_link:
                changes |= {"gains": LINK_GAINS}
                changes |= {"prior_delay": LINK_PRIOR[0], "prior_gain": LINK_PRIOR[1]}
        if name in given_gains:
            changes["gains"] = given_gains[name]
        if name in given_steps:
            if len(given_steps[name]) != 1:
                raise ValueError(f"--step of {name}: give one size")
            changes["step"] = given_steps[name][0]
        plans.append(FlightPlan.of_axis(cast(AxisName, name), **changes))
    return plans


def _by_axis(option: str, given: list[str], names: list[str]) -> dict[str, tuple[float, ...]]:
    """Numbers of each axis, from texts such as ``x=0.5,0.8``; without a name they are of z."""
    found: dict[str, tuple[float, ...]] = {}
    for text in given:
        name, _, numbers = text.rpartition("=")
        name = name.strip() or "z"
        if name not in names:
            raise ValueError(f"{option} {text}: the axis {name} is not flown, see --axes")
        if name in found:
            raise ValueError(f"{option} {text}: {name} is given twice")
        try:
            found[name] = tuple(float(part) for part in numbers.split(",") if part.strip())
        except ValueError:
            raise ValueError(f"{option} {text}: give numbers with commas between them") from None
    return found


def _two_delays(text: str) -> tuple[float, float]:
    try:
        first, longest = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"--moving-delay {text}: give two delays, such as 0.1,0.5") from None
    return first, longest


def _free_folder() -> Path:
    number, folder = 1, Path(FOLDER)
    while folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        number += 1
        folder = Path(f"{FOLDER}-{number}")
    return folder


def _print_plan(plans: list[FlightPlan], vehicle: str) -> None:
    print_text(f"About to fly {vehicle}:", on=ERRORS)
    axes = tuple(plan.axis for plan in plans)
    for line in (*(plan.line() for plan in plans), *plans[0].limits.lines(axes)):
        print_text(f"  {line}", wrapped=False, on=ERRORS)


def _ask_for_consent(host: str, plans: list[FlightPlan], consent: bool) -> None:
    _print_plan(plans, f"a drone at {host}")
    if not consent:
        raise ValueError(
            f"nothing was sent to {host}: a drone there would take off twice and fly as said "
            "above. If nobody and nothing can be hurt by it, add --i-have-a-safe-area"
        )


def _print_kept_recordings(folder: Path) -> None:
    kept = sorted(folder.glob("flight-*.csv"))
    if kept:
        print_text(f"kept in {folder}: {', '.join(path.name for path in kept)}", on=ERRORS)


def _print_study(study: FlightStudy) -> None:
    axis = study.axis.name
    print_table(results_table(COLUMNS, study.rows(), f"Flights on {axis}", COLUMNS[:1]))
    print_table(results_table(PARTS, study.parts(), f"The delay on {axis}", PARTS[:1]))
    print_text(study.verdict(), "bold")
