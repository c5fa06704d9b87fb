"""Options that several commands share, and the loop they describe."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from deadtime._base.validation import finite
from deadtime._cli.fills import Fills
from deadtime._cli.plants import plant_from
from deadtime._cli.show import check_picture
from deadtime.loops import (
    PD,
    PI,
    PID,
    PV,
    Controller,
    ControlLoop,
    DerivativeFilter,
    Integrator,
    P,
    RationalPlant,
)


def _drawn_later(path: Path | None) -> Path | None:
    """Refuse a picture that cannot be written before the work for it begins."""
    if path is not None:
        check_picture(path)
    return path


#: The ends of a range.
Ends = tuple[float, float]

File = Annotated[
    Path,
    typer.Argument(
        help="A table: CSV with a header line, Parquet, Arrow or MAT.", show_default=False
    ),
]
Time = Annotated[
    str | None,
    typer.Option(
        help="Column of the time stamps, s. Default: the column with a usual name, such as time.",
        show_default=False,
    ),
]
Reference = Annotated[
    str | None,
    typer.Option(
        help="Column of the reference. Default: the column with a usual name, such as reference.",
        show_default=False,
    ),
]
Output = Annotated[
    str | None,
    typer.Option(
        help="Column of the measured output. Default: the column with a usual name, such as "
        "output.",
        show_default=False,
    ),
]
Command = Annotated[
    str | None, typer.Option(help="Column of the command, if the command was logged.")
]
Window = Annotated[
    Ends | None, typer.Option(help=("Use only the samples between these two times, s."))
]
Kp = Annotated[float, typer.Option(help="Proportional gain.", show_default=False)]
Kv = Annotated[float, typer.Option(help="Velocity gain.")]
Delay = Annotated[
    float | None,
    typer.Option(
        help=(
            "Delay of the loop, s. The delay of --plant is added. Default: 0 if --plant has a "
            "delay."
        ),
        show_default=False,
    ),
]
Gain = Annotated[
    float,
    typer.Option(
        help=("Gain of the integrating plant. With --plant, a factor that multiplies this plant.")
    ),
]
Plant = Annotated[
    str | None,
    typer.Option(
        help="Plant instead of the integrator, such as '0.9/(s*(0.1*s+1))'. delay(T) is a delay "
        "of T s, which is added to the delay of the loop."
    ),
]
Lag = Annotated[float, typer.Option(help="Lag of the plant, s.")]
Sample_time = Annotated[
    float | None,
    typer.Option(
        help=(
            "Time between commands, s. Each command is held until the next. Default: a continuous "
            "controller."
        )
    ),
]
Limit = Annotated[float | None, typer.Option(help="Largest magnitude that the command can have.")]
Filter = Annotated[
    float | None,
    typer.Option(help="Corner frequency of the derivative's filter, rad/s. Default: no filter."),
]
Plot = Annotated[
    Path | None,
    typer.Option(help="Write a picture to this file (.png, .svg or .pdf).", callback=_drawn_later),
]
As_json = Annotated[bool, typer.Option("--json", help="Print only JSON.")]
Flight = Annotated[
    int | None,
    typer.Option(
        help="Number of the flight in a Blackbox file, from 1. Default: the longest flight.",
        show_default=False,
    ),
]


#: Upper limit on the ratio of the simulated time to the shortest time of the loop (bounds time).
MOST_PARTS = 1e6

SHORT_TIMES = ("delay", "lag", "sample_time")


def described_loop(
    kp: float,
    kv: Kv = 0.0,
    delay: float | None = None,
    gain: Gain = 1.0,
    lag: Lag = 0.0,
    *,
    ki: float = 0.0,
    kd: float = 0.0,
    sample_time: Sample_time = None,
    limit: Limit = None,
    corner: float | None = None,
    plant: Plant = None,
) -> ControlLoop:
    """The loop that the options describe: an integrator or `plant`, and the controller."""
    given = {"kp": kp, "kv": kv, "ki": ki, "kd": kd, "gain": gain, "lag": lag}
    for name, value in given.items():
        if not math.isfinite(value):
            raise ValueError(f"--{name} is {value}: give a finite number")
    controller = _described_controller(kp, kv, ki, kd, corner)
    if plant is not None and lag != 0.0:
        raise ValueError(
            "--lag belongs to the integrating plant, but --plant gives another plant: write the "
            "lag into --plant"
        )
    loop = ControlLoop(
        Integrator(gain=gain, lag=lag) if plant is None else plant_from(plant),
        controller,
        delay=delay,
        sample_time=sample_time,
        limit=limit,
    )
    return loop if plant is None else loop.replace(gain=gain)


def delay_beside(plant: Plant, delay: Delay) -> float:
    """The delay besides that of `plant`; zero if it is not given and `plant` has one."""
    if delay is not None:
        return delay
    G = None if plant is None else plant_from(plant)
    if G is None or not (G.num.delays.any() or G.den.delays.any()):
        raise ValueError(
            "--delay is missing: give the delay of the loop in s, or write the delay into "
            "--plant as delay(T)"
        )
    return 0.0


#: The numbers of a loop that have no special help in a command.
LOOP = Fills(described_loop, "plant gain lag sample_time limit")


def _described_controller(
    kp: float, kv: float, ki: float, kd: float, corner: float | None
) -> Controller:
    """P, PV, PD, PI or PID, by which gains are not zero."""
    smoothing = None if corner is None else DerivativeFilter(omega=corner)
    if kv != 0.0:
        if ki != 0.0 or kd != 0.0:
            raise ValueError(
                "--kv is a gain of PV control, and --ki and --kd are gains of PI, PD and PID "
                "control: give --kv alone, or leave --kv out"
            )
        return PV(Kp=kp, Kv=kv, filter=smoothing)
    if ki != 0.0:
        return PI(Kp=kp, Ki=ki) if kd == 0.0 else PID(Kp=kp, Ki=ki, Kd=kd, filter=smoothing)
    return P(Kp=kp) if kd == 0.0 else PD(Kp=kp, Kd=kd, filter=smoothing)


def check_duration(loop: ControlLoop, duration: float | None = None) -> None:
    """Refuse a simulation that would take minutes, since the loop has very short times.

    Without a `duration`: of ten times the longest time of the loop, as for a step response.
    """
    numbers = loop.parameters
    times = {f"--{name.replace('_', '-')}": numbers.get(name, 0.0) for name in SHORT_TIMES}
    if "omega" in numbers:
        times["one over --filter"] = 1.0 / numbers["omega"]
    if isinstance(loop.plant, RationalPlant):
        fastest = float(np.abs(np.roots(loop.plant.den)).max(initial=0.0))
        times["1 divided by the fastest pole of --plant"] = 1.0 / fastest if fastest else 0.0
    if duration is None:
        duration = 10.0 * max(times.values())
    finite("--duration", duration)
    for name, length in times.items():
        if 0.0 < length < duration / MOST_PARTS:
            raise ValueError(
                f"{name} is {length:g} s, less than a millionth of the {duration:g} s to "
                "simulate, so the simulation would take too long. Leave this time out, or "
                "simulate a shorter time"
            )
