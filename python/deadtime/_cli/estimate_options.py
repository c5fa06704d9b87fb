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
        help="Tables that were recorded from one vehicle: CSV with a header line, Parquet, Arrow "
        "or MAT. With FILE@LOW:HIGH only the times from LOW to HIGH are read, in s.",
        show_default=False,
    ),
]
Kp = Annotated[
    list[float] | None,
    typer.Option(
        help="Proportional gain of the controller in the loop. Give one value for all files, or "
        "one value for each file. With a P controller the recording needs no command.",
        show_default=False,
    ),
]
Kv = Annotated[
    list[float] | None, typer.Option(help="Velocity gain of a PV controller.", show_default=False)
]
Ki = Annotated[
    list[float] | None,
    typer.Option(help="Integral gain of a PI or PID controller.", show_default=False),
]
Kd = Annotated[
    list[float] | None,
    typer.Option(help="Derivative gain of a PD or PID controller.", show_default=False),
]
Plant = Annotated[
    str | None,
    typer.Option(
        help="Plant. Default: chosen from the recording. Without --kp, the name of a kind of "
        "plant, such as 'two lags'. With --kp, also a formula, such as '0.9/(s*(0.1*s+1))'. "
        "In a formula, delay(T) is a delay of T s, which is added to the delay of the loop. "
        "auto/s is an integrator with as many lags as the recording shows. auto has as many "
        "lags, but no integrator."
    ),
]
Method = Annotated[
    str | None,
    typer.Option(
        help=f"Method of the fit: {', '.join(CHOICES)}. It needs an integrator, or the plant "
        "given by --plant as a formula. all compares the methods. Default: auto for several "
        "files; all for one file with a given plant; else the plant is chosen from the "
        "recording.",
        show_default=False,
    ),
]
Free = Annotated[
    str | None,
    typer.Option(
        help="Parameters that are fitted, with one method: delay and gain; lag for an "
        "integrator; time_constant for a first-order plant; lag_1, lag_2, … and zero for "
        "several real poles; also limit and start for waveform. Default: delay,gain.",
        show_default=False,
    ),
]
Map = Annotated[
    OvershootMap | None,
    typer.Option(
        help=("Formula with which --method overshoot computes the delay from the overshoot.")
    ),
]
Noise_path = Annotated[
    NoisePath | None,
    typer.Option(
        help=(
            "Whether the sensor noise is only in the recording, or also enters the loop. Used by "
            "the method waveform."
        )
    ),
]
Initial_output = Annotated[
    float | None,
    typer.Option(
        help=(
            "True output at the first row, if it is known. Used by the methods output_error, "
            "waveform, grid and cta."
        )
    ),
]
At_rest = Annotated[
    bool | None,
    typer.Option(
        "--at-rest/--not-at-rest",
        help="Whether the plant was at rest at the first row. Default: judged from the "
        "recording. Applies only if the plant is chosen from the recording.",
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
        help="Only check the files, and print the findings without an estimate. The exit code is "
        "1 if a file cannot be used.",
    ),
]
