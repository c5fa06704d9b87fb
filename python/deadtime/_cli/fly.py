"""``deadtime fly``: the experiment of the paper, with an emulator or a drone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeAlias, cast

import typer

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.fills import Fills, Given, filled
from deadtime._cli.show import ERRORS, print_json, print_table, print_text, results_table, stages
from deadtime._cli.vehicles import VehicleOptions
from deadtime.flights import (
    COLUMNS,
    PARTS,
    USUAL,
    AdaptivePlan,
    FlightPlan,
    FlightReport,
    FlightStudy,
    fly_and_report,
)
from deadtime.links import Limits
from deadtime.links.ardrone2 import ARDrone2
from deadtime.links.axes import AxisName

#: Largest commanded climb in m/s: on this computer, as in the paper, and elsewhere: it can hurt.
EMULATED_CLIMB, REAL_CLIMB = FlightPlan().limits.max_climb, Limits().max_climb

CLIMB = (
    f"Largest vertical speed that is commanded, m/s. Default: {EMULATED_CLIMB:g} (as in the "
    f"paper) for an emulator on this computer, {REAL_CLIMB:g} for any other vehicle."
)
LONGEST = Annotated[
    float,
    typer.Option(
        "--longest-delay",
        help="Longest delay for which --adapt proves that its gains are stable, s.",
    ),
]

#: The options of the ports; the help of the first is that of all.
PORTS = {
    "navdata_port": Annotated[int, typer.Option(help="UDP or TCP port of --host.")],
    "command_port": Annotated[int, typer.Option(help="")],
    "control_port": Annotated[int, typer.Option(help="")],
}

#: Default folder for recordings.
FOLDER = "flight"

Texts: TypeAlias = list[str] | None


@filled
def command(
    *,
    vehicle: Annotated[
        Given, Fills(VehicleOptions, "host link key consent=--i-have-a-safe-area plant")
    ],
    axes: Annotated[str, typer.Option(metavar="AXIS,…")] = "z",
    gains: Annotated[Texts, typer.Option(metavar="[AXIS=]K,…")] = None,
    step: Annotated[Texts, typer.Option(metavar="[AXIS=]SIZE")] = None,
    start: Annotated[Given, Fills(FlightPlan, "base")],
    max_climb: Annotated[float | None, typer.Option(help=CLIMB)] = None,
    beyond: Annotated[Given, Fills(Limits, "max_height max_speed max_distance")],
    times: Annotated[Given, Fills(FlightPlan, "hold")],
    folder: Path | None = None,
    restore: bool = False,
    adapt: bool = False,
    adaptive: Annotated[Given, Fills(AdaptivePlan, "longest", longest=LONGEST)],
    emulated: Annotated[Given, Fills(VehicleOptions, "moving_delay seed virtual_time")],
    ports: Annotated[Given, Fills(ARDrone2, " ".join(PORTS), **PORTS)],
    as_json: opt.As_json = False,
) -> None:
    """Fly steps under P control, estimate the delay, design PV gains, and fly these gains.

    Parameters
    ----------
    axes
        Axes on which steps are flown, one after another: z (height), x (north), y (east), yaw
        (heading). An AR.Drone has only z.
    gains
        Proportional gains of the first flights, which give the estimate. For another axis than z,
        write its name first, as in x=0.5,0.8. For several axes, repeat the option.
    step
        Size of the steps, m or (for yaw) rad. Default: 0.25 for z, 0.5 for x and y, 0.4 for yaw.
        For another axis than z, write its name first, as in x=1. For several axes, repeat the
        option.
    folder
        Folder for recordings and report. Default: flight, flight-2, …
    restore
        Do not fly, but restore the parameters that an earlier run has left changed in the vehicle
        at --link. The old values are read from a file in --folder or in the working directory.
    adapt
        Afterwards fly two more flights, one with robust gains and one with gains that follow the
        delay. The stability of both is proved.
    """
    chosen = VehicleOptions(**vehicle, **emulated, ports=ports)
    if restore:
        _print_restored(chosen.restored(folder), as_json)
        return
    if max_climb is None:
        max_climb = EMULATED_CLIMB if chosen.elsewhere is None else REAL_CLIMB
    limits = Limits(max_climb=max_climb, **beyond)
    plans = _plans(axes, gains or [], step or [], chosen.link is not None, limits, start | times)
    check_pages()  # needed for the report; fail before anything flies
    moving = chosen.moving()
    if chosen.elsewhere is not None or not as_json:
        _print_plan(plans, chosen.name)
    chosen.check_consent()
    where = _free_folder() if folder is None else folder
    count = sum(plan.flights for plan in plans) + (6 if adapt else 2) * len(plans)
    follow = AdaptivePlan(**adaptive) if adapt else None
    try:
        with (
            chosen.flown(limits, start["base"], moving, where) as flown,
            stages(count, quiet=as_json) as begin,
        ):
            found = fly_and_report(flown, plans, where, follow, begin, _print_note)
    except BaseException as error:
        for note in getattr(error, "__notes__", ()):
            _print_note(note)
        raise
    if as_json:
        print_json("flight", found.to_dict())
    else:
        _print_report(found)


def _print_note(sentence: str) -> None:
    print_text(f"deadtime: {sentence}", wrapped=False, on=ERRORS)


def _plans(
    axes: str,
    gains: list[str],
    step: list[str],
    autopilot: bool,
    limits: Limits,
    given: Given,
) -> list[FlightPlan]:
    """The plan of each axis, checked."""
    names = [name.strip() for name in axes.split(",") if name.strip()]
    unknown = [name for name in names if name not in USUAL]
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"--axes {axes}: give some of {', '.join(USUAL)}, and each only once")
    given_gains, given_steps = _by_axis("--gains", gains, names), _by_axis("--step", step, names)
    checked_hold = min(given["hold"], FlightPlan().checked_hold)
    plans = []
    for name in names:
        changes: dict[str, Any] = given | {"limits": limits, "checked_hold": checked_hold}
        if name != "z":
            del changes["base"]
        if name in given_gains:
            changes["gains"] = given_gains[name]
        if name in given_steps:
            if len(given_steps[name]) != 1:
                raise ValueError(f"--step gives several sizes for the axis {name}: give one size")
            changes["step"] = given_steps[name][0]
        plans.append(FlightPlan.of_axis(cast(AxisName, name), autopilot, **changes))
        plans[-1].check()
    return plans


def _by_axis(option: str, given: list[str], names: list[str]) -> dict[str, tuple[float, ...]]:
    """Numbers of each axis, from texts such as ``x=0.5,0.8``; without a name they are of z."""
    found: dict[str, tuple[float, ...]] = {}
    for text in given:
        name, _, numbers = text.rpartition("=")
        name = name.strip() or "z"
        if name not in names:
            raise ValueError(
                f"{option} {text}: the axis {name} is not in --axes. Add this axis to --axes, or "
                f"remove it from {option}"
            )
        if name in found:
            raise ValueError(f"{option} {text}: the axis {name} is given twice")
        try:
            found[name] = tuple(float(part) for part in numbers.split(",") if part.strip())
        except ValueError:
            raise ValueError(f"{option} {text}: give numbers with commas between them") from None
    return found


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


def _print_restored(said: list[str], as_json: bool) -> None:
    if as_json:
        print_json("restored", {"restored": said})
    else:
        print_text(
            "\n".join(said)
            or (
                "there is nothing to restore, because no earlier run has left changed parameters "
                "in the vehicle"
            )
        )


def _print_report(found: FlightReport) -> None:
    for study in found.studies:
        _print_study(study)
        if study.axis.name in found.adapted:
            print_text("\n".join(found.adapted[study.axis.name].lines()))
    print_text(
        f"\nThe recordings and the report {found.page.name} are in the folder {found.folder}."
    )
    if found.round_trip is not None:
        print_text(
            "The round trip time of the link, measured by TIMESYNC, was "
            f"{1e3 * found.round_trip:.1f} ms."
        )


def _print_study(study: FlightStudy) -> None:
    axis = study.axis.name
    print_table(results_table(COLUMNS, study.rows(), f"Flights on {axis}", COLUMNS[:1]))
    print_table(results_table(PARTS, study.parts(), f"The delay on {axis}", PARTS[:1]))
    print_text(study.headline(), "bold")
