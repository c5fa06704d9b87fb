"""``deadtime internet-loop``: estimate and measure the delay of a control loop over UDP."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from deadtime._base.digits import shown, stated
from deadtime._base.drawing import new_figure
from deadtime._cli import options as opt
from deadtime._cli.show import (
    print_json,
    print_points,
    print_table,
    print_text,
    results_table,
    save_figure,
    stages,
)
from deadtime.internet import (
    GAINS,
    LABELS,
    InternetRun,
    Spread,
    plot_internet_loop,
    run_internet_loop,
)
from deadtime.links.udp import Trial, network_of, policy_of
from deadtime.paper import PRINTED_OVERSHOOTS, delay_by_dominant_root

Kind = Literal["normal", "gamma", "lognormal"]
Late = Literal["newest", "drop-late", "hold", "jitter-buffer"]

HEADS = (
    "K",
    "round trip p50 / p95",
    "lost",
    "late",
    "age",
    "Mo",
    "paper's overshoot",
    "exact overshoot",
    "waveform",
    "output error",
    "Table 1: Mp",
    "Td",
)


def command(
    gain: Annotated[
        list[float] | None,
        typer.Option(help="Gain K of a run; again for the next. Without: 5 to 10.", min=0.0),
    ] = None,
    delay: Annotated[float, typer.Option(help="Mean one-way delay, s.", min=0.0)] = 0.05,
    jitter: Annotated[float, typer.Option(help="Its standard deviation, s.", min=0.0)] = 0.0,
    delays: Annotated[Kind, typer.Option(help="Its distribution.")] = "gamma",
    loss: Annotated[float, typer.Option(help="Part of the packets lost.", min=0.0)] = 0.0,
    burst: Annotated[float, typer.Option(help="Mean length of a burst of losses.", min=1.0)] = 1.0,
    duplication: Annotated[float, typer.Option(help="Part that comes twice.", min=0.0)] = 0.0,
    ordered: Annotated[
        bool, typer.Option("--ordered", help="No packet overtakes another.")
    ] = False,
    policy: Annotated[Late, typer.Option(help="What the plant does with late commands.")] = (
        "newest"
    ),
    policy_number: Annotated[
        float | None,
        typer.Option(
            help="Of the policy: largest age (drop-late), samples held (hold), constant age "
            "(jitter-buffer); times in s."
        ),
    ] = None,
    sample_time: Annotated[
        float, typer.Option(help="Time between two measurements, s.", min=1e-4)
    ] = 0.01,
    duration: Annotated[float, typer.Option(help="Of a run, s; it steps after 1 s.")] = 6.0,
    lag: opt.Lag = 0.0,
    limit: Annotated[float, typer.Option(help="Largest size of the command.")] = 20.0,
    watchdog: Annotated[
        float, typer.Option(help="Silence after which each side is safe, s.")
    ] = 0.5,
    seed: Annotated[int, typer.Option(min=0, help="Of delays and losses.")] = 0,
    virtual_time: Annotated[
        bool,
        typer.Option("--virtual-time", help="Not over UDP but in memory, as fast as it goes."),
    ] = False,
    folder: Annotated[
        Path | None, typer.Option(help="Keep the recordings of both ends here.")
    ] = None,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Control an integrator over UDP, estimate the loop's delay, and measure it."""
    path = network_of(delays, delay, jitter, loss, burst, duplication, ordered)
    gains = tuple(gain) if gain else GAINS
    trial = Trial(
        gain=gains[0],
        forward_path=path,
        return_path=path,
        seed=seed,
        sample_time=sample_time,
        duration=duration,
        lag=lag,
        limit=limit,
        policy=policy_of(policy, policy_number),
        watchdog=watchdog,
    )
    if duration < trial.rest + 1.0:
        raise ValueError(
            f"--duration {duration:g} leaves less than 1 s after the step at {trial.rest:g} s: "
            "give a longer one"
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
        float(one): delay_by_dominant_root(one, percent / 100.0)
        for one, percent in PRINTED_OVERSHOOTS.items()
    }
    if plot is not None:
        figure, axes = new_figure(10.0, 4.2, columns=2)
        plot_internet_loop(found, printed, axes)
        save_figure(figure, plot)
    if as_json:
        print_json("internet-loop", {**found.to_dict(), "table_1": printed})
        return
    rows = [_row(run, printed) for run in found.runs]
    print_table(results_table(HEADS, rows, "Times in ms"))
    print_text("means, 95 % intervals, and what was measured", "dim")
    for method, (label, *_) in LABELS.items():
        print_text(f"{label:<20}{_spread_text(found.spread(method), found.expected(method))}")
    print_points(found.explanation())
    print_points(
        f"K = {run.trial.gain:g}, {LABELS[method][0]}: {why}"
        for run in found.runs
        for method, why in run.refusals.items()
    )
    if folder is not None:
        print_text(f"recordings: {folder}")


def _row(run: InternetRun, printed: dict[float, float]) -> list[str]:
    gain, trip, link = run.trial.gain, run.round_trip, run.plant["link"]
    table_1 = (
        [f"{PRINTED_OVERSHOOTS[int(gain)]:g} %", _ms(printed[gain])] if gain in printed else []
    )
    return [
        f"{gain:g}",
        f"{_ms(trip['p50'])} / {_ms(trip['p95'])}",
        str(link["lost"] + run.controller["link"]["lost"]),
        f"{link['late']}/{link['received']}",
        _ms(run.age),
        f"{100 * run.overshoot:.1f} %" if math.isfinite(run.overshoot) else "–",
        *(_estimate(run, method) for method in LABELS),
        *(table_1 or ["–", "–"]),
    ]


def _estimate(run: InternetRun, method: str) -> str:
    fit = run.estimates.get(method)
    if fit is None:
        return "refused"
    error = fit.stderr.get("delay", math.nan)
    told = stated(1e3 * fit.delay, 1e3 * error)
    return told if fit.adequate and "±" in told else _ms(fit.delay)


def _ms(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{1e3 * value:.1f}"


def _spread_text(spread: Spread, expected: float) -> str:
    """The mean of a method over the runs, its interval, and the measured delay."""
    interval = f"; {spread.interval}" if spread.interval else ""
    mean = shown(spread.mean, spread.error, "s") if spread.count else "–"
    return f"mean {mean}{interval}; measured {stated(expected, math.nan, 's')}"
