"""``deadtime demo``: from a simulated flight to its delay and its gains."""

from __future__ import annotations

import csv
import shlex
from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.comparisons import estimates_table
from deadtime._cli.show import print_json, print_points, print_table, print_text, stages
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording
from deadtime.reports import demo_recording, study, write_report


def command(
    folder: Annotated[Path, typer.Option(help="Where to write.")] = Path("demo"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sensor noise.")] = 1,
    as_json: opt.As_json = False,
) -> None:
    """Fly a simulated loop with known truth and find its delay and its gains; no hardware."""
    check_pages()
    with stages(6, quiet=as_json) as begin:
        begin("flying the simulated loop")
        flight = demo_recording(seed)
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "flight.csv"
        _write_flight(flight.recording, file)
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
                "verdict": found.verdict(),
                "flight": file,
                "report": page,
            },
        )
        return
    print_table(estimates_table(found.comparison, flight.numbers))
    print_points(found.comparison.explanation())
    print_text(f"\n{found.verdict()}", "bold")
    print_text(f"\nThe flight is in {file}, the report in {page}. To go on:")
    for line in _next_commands(found.known, flight.window, file, found.fit):
        print(f"  {line}")


def _write_flight(recording: Recording, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow(["t_s", "ref_m", "height_m"])
        for time, reference, output in zip(
            recording.time, recording.reference, recording.output, strict=True
        ):
            rows.writerow([f"{time:.3f}", f"{reference:.3f}", f"{output:.5f}"])


def _next_commands(loop: ControlLoop, window: opt.Ends, file: Path, fit: object) -> list[str]:
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
