"""``deadtime demo``: from a simulated flight to its delay and its gains."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from deadtime._base.bounds import Bounds
from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.comparisons import estimates_table
from deadtime._cli.fills import filled
from deadtime._cli.show import print_json, print_points, print_table, print_text, stages, write_rows
from deadtime.loops import ControlLoop
from deadtime.reports import demo_recording, study, write_report

#: What is written of the flight.
COLUMNS = ("time", "reference", "output")


@filled
def command(
    folder: Path = Path("demo"),
    seed: Annotated[int, Bounds(0)] = 1,
    methods: Annotated[bool, typer.Option("--all")] = False,
    as_json: opt.As_json = False,
) -> None:
    """Simulate a loop whose delay is known, find the delay, and design gains for it.

    Parameters
    ----------
    folder
        Folder to which all files are written.
    seed
        Seed of the sensor noise.
    methods
        Also print the estimates of all methods, and why these estimates differ.
    """
    check_pages()
    with stages(6, quiet=as_json) as begin:
        begin("flying the simulated loop")
        flight = demo_recording(seed)
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "flight.csv"
        rows = np.column_stack([getattr(flight.recording, name) for name in COLUMNS]).tolist()
        cells = [(f"{time:.3f}", f"{ref:.3f}", f"{output:.5f}") for time, ref, output in rows]
        write_rows(file, ("t_s", "ref_m", "height_m"), cells)
        found = study(
            flight.recording, flight.known, window=flight.window, truth=flight, progress=begin
        )
    page = write_report(found, folder / "report.html")
    if as_json:
        print_json(
            "demo",
            {
                "truth": flight.numbers,
                "estimates": {
                    name: fit.to_dict() for name, fit in found.comparison.estimates.items()
                },
                "gains": found.designed.gains,
                "verdict": found.verdict,
                "headline": found.headline(),
                "flight": file,
                "report": page,
            },
        )
        return
    if methods:
        print_table(estimates_table(found.comparison, flight.numbers))
        print_points(found.comparison.explanation())
        print_text("")
    print_text(
        "A simulated vehicle with a lag gets its commands over a radio link with a delay of "
        f"{flight.truth.delay:g} s. The measured height is noisy. The true sum of delay and lag "
        f"is {flight.numbers['delay+lag']:.3f} s."
    )
    print_text(f"\n{found.headline()}\n", "bold")
    if methods:
        for line in _next_commands(found.known, flight.window, file):
            print(line)
    print(f"open {page}")
    print("To use your own file: deadtime estimate FILE")


def _next_commands(loop: ControlLoop, window: opt.Ends, file: Path) -> list[str]:
    columns = (
        f"{shlex.quote(str(file))} --time t_s --reference ref_m --output height_m "
        f"--kp {loop.controller.gains['Kp']:g} --sample-time {loop.sample_time:g} "
        f"--limit {loop.limit:g} --window {window[0]:g} {window[1]:g}"
    )
    return [
        f"deadtime estimate {columns} --method waveform --free delay,gain,lag",
        f"deadtime estimate {columns} --method overshoot --map exact",
        f"deadtime report {columns} --out {shlex.quote(str(file.with_name('again.html')))}",
    ]
