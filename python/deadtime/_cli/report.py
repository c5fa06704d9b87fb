"""``deadtime report``: one page about a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.show import print_json, print_text, stages
from deadtime.recordings import read_recording
from deadtime.reports import study, write_report


def command(
    file: opt.File,
    kp: opt.Kp,
    time: opt.Time = "time",
    reference: opt.Reference = "reference",
    output: opt.Output = "output",
    command: opt.Command = None,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    plant: opt.Plant = None,
    gain: opt.Gain = 1.0,
    window: opt.Window = None,
    out: Annotated[Path, typer.Option(help="The page to write.")] = Path("report.html"),
    as_json: opt.As_json = False,
) -> None:
    """Write one page about a recording: delay, map of gains, a controller to try."""
    check_pages()
    recording = read_recording(file, time=time, reference=reference, output=output, command=command)
    loop = opt.described_loop(kp, gain=gain, sample_time=sample_time, limit=limit, plant=plant)
    with stages(5, quiet=as_json) as begin:
        found = study(recording, loop, window=window, progress=begin)
    write_report(found, out)
    if as_json:
        print_json(
            "report", {"verdict": found.verdict(), "report": out, "gains": found.designed.gains}
        )
        return
    print_text(found.verdict())
    print_text(f"report: {out}")
