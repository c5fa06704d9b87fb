"""``deadtime simulate``: the step response of a loop."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from deadtime._base.drawing import new_figure
from deadtime._cli import options as opt
from deadtime._cli.show import print_json, print_text, save_figure
from deadtime._cli.verdicts import verdict
from deadtime.systems import plot_responses

#: Metrics that a step response has also without a steady state.
PEAK = ("peak", "peak_time")


def command(
    kp: opt.Kp,
    delay: opt.Delay,
    kv: opt.Kv = 0.0,
    plant: opt.Plant = None,
    gain: opt.Gain = 1.0,
    lag: opt.Lag = 0.0,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    filter: opt.Filter = None,  # noqa: A002
    duration: Annotated[float, typer.Option(min=1e-6, help="How long, s.")] = 10.0,
    amplitude: Annotated[float, typer.Option(help="Size of the step.")] = 1.0,
    points: Annotated[int, typer.Option(min=2, max=10_000_000, help="Output times.")] = 501,
    out: Annotated[
        Path | None, typer.Option(help="Write time, reference, output, command.")
    ] = None,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Simulate the step response of a loop, exactly."""
    loop = opt.described_loop(
        kp, kv, delay, gain, lag, sample_time=sample_time, limit=limit, corner=filter, plant=plant
    )
    opt.check_duration(loop, duration)
    time = np.linspace(0.0, duration, points)
    response = loop.simulate(time, amplitude)
    if out is not None:
        with out.open("w", newline="", encoding="utf-8") as stream:
            rows = csv.writer(stream)
            rows.writerow(["time_s", "reference", "output", "command"])
            rows.writerows(
                zip(
                    time.tolist(),
                    [amplitude] * points,
                    response.outputs.tolist(),
                    response.inputs.tolist(),
                    strict=True,
                )
            )
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
    limited = " (without the limit on its command)" if limit is not None else ""
    print_text(f"the loop{limited} is {verdict(loop)}")
    for name, value in figures.items():
        if stable or name in PEAK:
            shown = f"{value:.6g}" if np.isfinite(value) else "not within the time simulated"
            print_text(f"{name.replace('_', ' '):<20}{shown}")
