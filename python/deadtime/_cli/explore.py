"""``deadtime explore``: a page in which a loop is looked at live."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deadtime._cli import options as opt
from deadtime._cli.columns import COLUMNS
from deadtime._cli.fills import Given, filled
from deadtime._cli.show import print_json, print_text
from deadtime.estimation import estimate_delay
from deadtime.recordings import read_recording


@filled
def command(
    *,
    file: Annotated[Path | None, typer.Argument(show_default=False)] = None,
    kp: float = 1.5,
    kv: opt.Kv = 0.0,
    ki: float = 0.0,
    kd: float = 0.0,
    delay: float = 0.36,
    numbers: Annotated[Given, opt.LOOP],
    filter: opt.Filter = None,  # noqa: A002
    columns: Annotated[Given, COLUMNS],
    window: opt.Window = None,
    out: Path | None = None,
    as_json: opt.As_json = False,
) -> None:
    """Explore a loop in the browser: its map of gains, roots, margins and responses.

    Parameters
    ----------
    file
        Table with a step of the loop, from which delay and gain are estimated. Default: the loop
        that the options describe.
    kp
        Proportional gain.
    ki
        Integral gain.
    kd
        Derivative gain, which acts on the derivative of the error.
    delay
        Delay of the loop, s.
    out
        Write the page to this file, and do not open the browser.
    """
    loop = opt.described_loop(kp, kv, delay, ki=ki, kd=kd, corner=filter, **numbers)
    if file is None:
        page = loop.explore()
    else:
        recording = read_recording(file, **columns)
        found = estimate_delay(recording, loop, free=("delay", "gain"), window=window)
        if not as_json:
            print_text(found.summary())
        page = found.explore()
    place = page.save(out) if out is not None else page.show()
    if as_json:
        print_json("explore", {"page": place, "state": page.state})
        return
    print_text(f"page: {place}")
