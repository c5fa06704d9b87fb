"""``deadtime internet-loop``: estimate and measure the delay of a control loop over UDP."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.bounds import Bounds
from deadtime._base.drawing import new_figure
from deadtime._cli import options as opt
from deadtime._cli.fills import Fills, Given, filled
from deadtime._cli.show import (
    print_json,
    print_points,
    print_table,
    print_text,
    results_table,
    save_figure,
    stages,
)
from deadtime.internet import COLUMNS, GAINS, in_ms, plot_internet_loop, run_internet_loop
from deadtime.links.udp import Trial, network_of, policy_of
from deadtime.paper import PRINTED_OVERSHOOTS, delay_by_dominant_root

#: Sample time and seed are narrower than those of a trial: a process keeps no shorter time.
SETTINGS = Fills(
    Trial,
    "sample_time duration lag limit watchdog seed",
    sample_time=Annotated[float, Bounds(1e-4)],
    duration=Annotated[
        float, typer.Option(help=("Duration of a run, s. The reference steps after 1 s."))
    ],
    seed=Annotated[int, Bounds(0)],
)


@filled
def command(
    *,
    gain: Annotated[list[float] | None, Bounds(0.0)] = None,
    network: Annotated[
        Given, Fills(network_of, "delay jitter kind=--delays loss burst duplication ordered")
    ],
    late: Annotated[Given, Fills(policy_of, "name=--policy number=--policy-number")],
    settings: Annotated[Given, SETTINGS],
    virtual_time: bool = False,
    folder: Path | None = None,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Control an integrator over UDP, and find the delay of this loop in two ways.

    Parameters
    ----------
    gain
        Gain K of a run. For several runs, repeat the option. Default: 5 to 10.
    virtual_time
        Simulate the network in memory instead of using UDP, as fast as possible.
    folder
        Folder in which the recordings of both ends are kept.
    """
    path = network_of(**network)
    gains = tuple(gain) if gain else GAINS
    trial = Trial(gains[0], path, path, policy=policy_of(**late), **settings)
    if trial.duration < trial.rest + 1.0:
        raise ValueError(
            f"--duration {trial.duration:g} ends less than 1 s after the step, which is at "
            f"{trial.rest:g} s: give a longer duration"
        )
    with stages(2 * len(gains) + 1, quiet=as_json) as begin:
        found = run_internet_loop(
            trial,
            gains,
            mode="virtual" if virtual_time else "processes",
            folder=folder,
            progress=begin,
        )
    printed = {
        float(printed_gain): delay_by_dominant_root(printed_gain, percent / 100.0)
        for printed_gain, percent in PRINTED_OVERSHOOTS.items()
    }
    if plot is not None:
        figure, axes = new_figure(10.0, 4.2, columns=2)
        plot_internet_loop(found, printed, axes)
        save_figure(figure, plot)
    if as_json:
        print_json("internet-loop", {**found.to_dict(), "table_1": printed})
        return
    heads = (*COLUMNS, "Table 1: Mp", "Td")
    rows = [(*run.row(), *_table_1(run.trial.gain, printed)) for run in found.runs]
    print_table(results_table(heads, rows, "Times in ms"))
    print_text("means, their 95 % intervals, and measured values", "dim")
    for line in found.lines():
        print_text(line)
    print_points([*found.explanation(), *found.refusals()])
    if folder is not None:
        print_text(f"recordings: {folder}")


def _table_1(gain: float, printed: dict[float, float]) -> tuple[str, str]:
    """What the paper's Table 1 has on a gain."""
    if gain not in printed:
        return "–", "–"
    return f"{PRINTED_OVERSHOOTS[int(gain)]:g} %", in_ms(printed[gain])
