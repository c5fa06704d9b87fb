"""``deadtime report``: one page about a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.columns import COLUMNS
from deadtime._cli.fills import Fills, Given, filled
from deadtime._cli.show import print_json, print_text, stages
from deadtime.recordings import read_recording
from deadtime.reports import study, write_report


@filled
def command(
    *,
    file: opt.File,
    kp: opt.Kp,
    columns: Annotated[Given, COLUMNS],
    numbers: Annotated[Given, Fills(opt.described_loop, "sample_time limit plant gain")],
    window: opt.Window = None,
    out: Path = Path("report.html"),
    as_json: opt.As_json = False,
) -> None:
    """Write a page about a recording: its delay, its map of gains, a controller to try.

    Parameters
    ----------
    out
        File of the page.
    """
    check_pages()
    recording = read_recording(file, **columns)
    loop = opt.described_loop(kp, **numbers)
    with stages(5, quiet=as_json) as begin:
        found = study(recording, loop, window=window, progress=begin)
    write_report(found, out)
    if as_json:
        print_json(
            "report",
            {
                "verdict": found.verdict,
                "headline": found.headline(),
                "report": out,
                "gains": found.designed.gains,
            },
        )
        return
    print_text(found.headline())
    print_text(f"report: {out}")
