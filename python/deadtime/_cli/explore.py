"""``deadtime explore``: a page in which a loop is looked at live."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deadtime._cli import options as opt
from deadtime._cli.show import print_json, print_text
from deadtime.estimation import estimate_delay
from deadtime.recordings import read_recording


def command(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Table with a step of the loop: the delay and the gain of the plant come from it. "
            "Without: the loop of the options.",
            show_default=False,
        ),
    ] = None,
    kp: Annotated[float, typer.Option(help="Proportional gain.")] = 1.5,
    kv: opt.Kv = 0.0,
    ki: Annotated[float, typer.Option(help="Integral gain.")] = 0.0,
    kd: Annotated[float, typer.Option(help="Gain on the derivative of the error.")] = 0.0,
    delay: Annotated[float, typer.Option(help="Delay of the loop, s.")] = 0.36,
    plant: opt.Plant = None,
    gain: opt.Gain = 1.0,
    lag: opt.Lag = 0.0,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    filter: opt.Filter = None,  # noqa: A002
    time: opt.Time = "time",
    reference: opt.Reference = "reference",
    output: opt.Output = "output",
    command: opt.Command = None,
    window: opt.Window = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the page here, and do not open it.", show_default=False),
    ] = None,
    as_json: opt.As_json = False,
) -> None:
    """Look at a loop live in the browser: its map of gains, roots, margins, responses."""
    loop = opt.described_loop(
        kp,
        kv,
        delay,
        gain,
        lag,
        ki=ki,
        kd=kd,
        sample_time=sample_time,
        limit=limit,
        corner=filter,
        plant=plant,
    )
    if file is None:
        page = loop.explore()
    else:
        recording = read_recording(
            file, time=time, reference=reference, output=output, command=command
        )
        found = estimate_delay(recording, loop, free=("delay", "gain"), window=window)
        if not as_json:
            print_text(found.summary())
        page = found.explore()
    place = page.save(out) if out is not None else page.show()
    if as_json:
        print_json("explore", {"page": place, "state": page.state})
        return
    print_text(f"page: {place}")
