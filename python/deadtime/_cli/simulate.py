"""``deadtime simulate``: the step response of a loop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np

from deadtime._base.bounds import Bounds
from deadtime._base.drawing import new_figure
from deadtime._cli import options as opt
from deadtime._cli.fills import Given, filled
from deadtime._cli.show import print_json, print_text, save_figure, write_rows
from deadtime._cli.verdicts import verdict
from deadtime.systems import plot_responses

#: Metrics that a step response has also without a steady state.
PEAK = ("peak", "peak_time")

#: Columns of the table that is written.
HEADS = ("time_s", "reference", "output", "command")


@filled
def command(
    *,
    kp: opt.Kp,
    delay: opt.Delay = None,
    kv: opt.Kv = 0.0,
    numbers: Annotated[Given, opt.LOOP],
    filter: opt.Filter = None,  # noqa: A002
    duration: Annotated[float, Bounds(1e-6)] = 10.0,
    amplitude: float = 1.0,
    points: Annotated[int, Bounds(2, 10_000_000)] = 501,
    out: Path | None = None,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Simulate the step response of a loop exactly.

    Parameters
    ----------
    duration
        Duration of the simulation, s.
    amplitude
        Size of the step.
    points
        Number of output times.
    out
        Write a table with time, reference, output and command to this file.
    """
    delay = opt.delay_beside(numbers["plant"], delay)
    loop = opt.described_loop(kp, kv, delay, corner=filter, **numbers)
    opt.check_duration(loop, duration)
    time = np.linspace(0.0, duration, points)
    response = loop.simulate(time, amplitude)
    if out is not None:
        columns = (time, np.full(points, amplitude), response.outputs, response.inputs)
        write_rows(out, HEADS, np.column_stack(columns).tolist())
    if plot is not None:
        figure, axes = new_figure(7.0, 3.8)
        plot_responses(axes, {"response": response})
        save_figure(figure, plot)
    stable = loop.is_stable()
    figures = response.info()
    if not stable:
        # Measured against a steady state, to which this loop does not come.
        figures = {name: figures[name] if name in PEAK else np.nan for name in figures}
    if as_json:
        print_json(
            "simulate",
            {
                "time": response.time,
                "output": response.outputs,
                "command": response.inputs,
                "stable": stable,
                "info": figures,
            },
        )
        return
    limited = " (the limit of the command is ignored)" if loop.limit is not None else ""
    print_text(f"the loop{limited} is {verdict(loop)}")
    for name, value in figures.items():
        if stable or name in PEAK:
            shown = f"{value:.6g}" if np.isfinite(value) else "not within the simulated time"
            print_text(f"{name.replace('_', ' '):<20}{shown}")
