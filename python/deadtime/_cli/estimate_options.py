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
        help="Tables of one vehicle: CSV with a header line, Parquet, Arrow or MAT. "
        "FILE@LOW:HIGH is a file with a window of its own.",
        show_default=False,
    ),
]
Kp = Annotated[
    list[float] | None,
    typer.Option(
        help="Proportional gain of the controller in the loop. This and the other gains: one, "
        "or one for each file. The command of a P controller need not be logged.",
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
    OvershootMap | None, typer.Option(help="Map from overshoot to delay, for the method overshoot.")
]
Noise_path = Annotated[
    NoisePath | None,
    typer.Option(
        help="For waveform: is the sensor noise in the recording alone, or in the loop too?"
    ),
]
Initial_output = Annotated[
    float | None,
    typer.Option(help="True output at the start, if known; for output_error, waveform, grid, cta."),
]
At_rest = Annotated[
    bool | None,
    typer.Option(
        "--at-rest/--not-at-rest",
        help="Was the plant at rest at the first row? Default: judged from the recording. Only if "
        "the plant is chosen from the recording.",
        show_default=False,
    ),
]
Closed_loop = Annotated[
    bool | None,
    typer.Option(
        "--closed-loop/--open-loop",
        help="Does a controller compute the command? Default: yes with --kp or a reference that "
        "moves. Only if the plant is chosen from the recording.",
        show_default=False,
    ),
]
Largest_delay = Annotated[
    float | None,
    typer.Option(
        help="Largest delay that is tried, s. Only if the plant is chosen from the recording."
    ),
]
Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Estimate nothing: print what a check of the files finds. The exit code is 1 if "
        "it refuses one.",
    ),
]
