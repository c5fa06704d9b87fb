"""Options of ``deadtime estimate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deadtime.estimation import METHODS, NoisePath, OvershootMap

#: What `--method` takes.
CHOICES = ("all", "auto", *METHODS)

Files = Annotated[
    list[Path],
    typer.Argument(
        help="Tables recorded from one vehicle: CSV with a header line, Parquet, Arrow or MAT. "
        "FILE@LOW:HIGH reads only the times LOW to HIGH, in s.",
        show_default=False,
    ),
]
Kp = Annotated[
    list[float] | None,
    typer.Option(
        help="Proportional gain of the controller in the loop. Give each gain once for all files, "
        "or once for each file. With a P controller the command need not be logged.",
        show_default=False,
    ),
]
Kv = Annotated[list[float] | None, typer.Option(help="Velocity gain, of PV.", show_default=False)]
Ki = Annotated[
    list[float] | None, typer.Option(help="Integral gain, of PI and PID.", show_default=False)
]
Kd = Annotated[
    list[float] | None, typer.Option(help="Derivative gain, of PD and PID.", show_default=False)
]
Plant = Annotated[
    str | None,
    typer.Option(
        help="Default: chosen from the recording. A kind, such as 'two lags'; or with --kp a "
        "formula, such as '0.9/(s*(0.1*s+1))', where delay(T) is a delay of T s, added to "
        "that of the loop. auto/s: an integrator with as many lags as the recording shows; "
        "auto: the same without an integrator."
    ),
]
Method = Annotated[
    str | None,
    typer.Option(
        help=f"{', '.join(CHOICES)}: for an integrator, or the formula of --plant. all: a "
        "comparison. Default: the plant is chosen from the recording; with a named plant, "
        "all, for several files auto.",
        show_default=False,
    ),
]
Free = Annotated[
    str | None,
    typer.Option(
        help="What is fitted, for one method: of delay, gain, lag of an integrator, time_constant "
        "of a first-order plant, lag_1, lag_2, … and zero of one of more real poles; for "
        "waveform also limit and start. Default: delay,gain.",
        show_default=False,
    ),
]
Map = Annotated[
    OvershootMap | None,
    typer.Option(help=("Map from overshoot to delay, used by the method overshoot.")),
]
Noise_path = Annotated[
    NoisePath | None,
    typer.Option(
        help=(
            "Whether the sensor noise is in the recording alone, or also in the loop. For the "
            "method waveform."
        )
    ),
]
Initial_output = Annotated[
    float | None,
    typer.Option(
        help=(
            "True output at the first row, if it is known. For the methods output_error, "
            "waveform, grid and cta."
        )
    ),
]
At_rest = Annotated[
    bool | None,
    typer.Option(
        "--at-rest/--not-at-rest",
        help="Whether the plant was at rest at the first row. Default: judged from the recording. "
        "Applies only if the plant is chosen from the recording.",
        show_default=False,
    ),
]
Closed_loop = Annotated[
    bool | None,
    typer.Option(
        "--closed-loop/--open-loop",
        help="Whether a controller computes the command. Default: yes, if --kp is given or the "
        "reference moves. Applies only if the plant is chosen from the recording.",
        show_default=False,
    ),
]
Largest_delay = Annotated[
    float | None,
    typer.Option(
        help=(
            "Largest delay that is tried, s. Applies only if the plant is chosen from the "
            "recording."
        )
    ),
]
Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Only check the files and print what the check finds, without an estimate. The exit "
        "code is 1 if a file is refused.",
    ),
]
