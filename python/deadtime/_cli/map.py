"""The command that maps gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
import typer
from rich.table import Table

from deadtime._base.drawing import new_figure
from deadtime._cli import options as opt
from deadtime._cli.show import (
    counted,
    print_json,
    print_table,
    print_text,
    results_table,
    save_figure,
)
from deadtime.loops import ControlLoop
from deadtime.roots import Crossings, crossings, delay_margin
from deadtime.stability import stability_map

Proof = Literal["curves", "cells"]
Gains = Literal["Kp", "Kv"]

#: What is printed of crossings as JSON.
CROSSINGS = ("parameter", "values", "omega", "direction", "counts", "unlisted")

#: Boundaries of a map that are printed.
SHOWN_CURVES = 4


def command(
    delay: opt.Delay = None,
    kp: Annotated[opt.Ends, typer.Option(help="Range of the proportional gain.")] = (0.0, 6.0),
    kv: Annotated[opt.Ends, typer.Option(help="Range of the velocity gain.")] = (-1.0, 1.0),
    plant: opt.Plant = None,
    gain: opt.Gain = 1.0,
    lag: opt.Lag = 0.0,
    sample_time: opt.Sample_time = None,
    filter: opt.Filter = None,  # noqa: A002
    shape: Annotated[tuple[int, int], typer.Option(help="Number of cells along each axis.")] = (
        121,
        121,
    ),
    counts: Annotated[
        bool,
        typer.Option(
            "--counts", help="Only count the unstable roots. This is several times faster."
        ),
    ] = False,
    decay: Annotated[
        float,
        typer.Option(
            help=(
                "Slowest allowed decay rate, 1/s. A cell with a root that decays more slowly "
                "counts as unstable."
            )
        ),
    ] = 0.0,
    damping: Annotated[
        opt.Ends | None,
        typer.Option(
            help="A damping ratio and a decay rate, 1/s. A cell counts as unstable if a root "
            "decays more slowly than this rate, with less damping than this ratio."
        ),
    ] = None,
    proof: Annotated[
        Proof,
        typer.Option(
            help="Prove stability for whole rows, by their crossings of the imaginary axis, or for "
            "each cell alone."
        ),
    ] = "curves",
    along: Annotated[
        Gains | None,
        typer.Option(help="List the values of this gain at which roots cross the imaginary axis."),
    ] = None,
    at: Annotated[
        float | None,
        typer.Option(help="Value of the other gain. Default: its value in the best cell."),
    ] = None,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Map which gains of a PV controller are stable, with the boundary and the best gains."""
    delay = opt.delay_beside(plant, delay)
    # The gains are varied: any that are not zero will do.
    loop = opt.described_loop(
        1.0, 0.1, delay, gain, lag, sample_time=sample_time, corner=filter, plant=plant
    )
    with counted("mapping", shape[0] * shape[1], quiet=as_json) as progress:
        chart = stability_map(
            loop,
            {"Kp": kp, "Kv": kv},
            shape=shape,
            abscissa=not counts,
            decay=decay,
            damping=damping,
            proof=proof,
            progress=progress,
        )
    best, abscissa, margin = None, np.nan, np.nan
    if chart.stable.any() and np.isfinite(chart.abscissa).any():
        best, abscissa = chart.best()
        margin = delay_margin(loop.replace(**best))
    crossed = None if along is None else _crossings_along(loop, along, at, best, chart.axes)
    curves = chart.boundaries
    if plot is not None:
        figure, axes = new_figure(7.0, 4.5)
        chart.plot(axes, best)
        save_figure(figure, plot)
    if as_json:
        print_json(
            "map",
            {
                "axes": chart.axes,
                "unstable": chart.unstable,
                "abscissa": None if counts else chart.abscissa,
                "status": chart.status,
                "boundaries": [
                    {**curve.values, **_attributes(curve, "omega", "crossing", "along")}
                    for curve in curves
                ],
                "best": best,
                "best_abscissa": abscissa,
                "best_delay_margin": margin,
                "crossings": None if crossed is None else _attributes(crossed, *CROSSINGS),
            },
        )
        return
    cells = chart.stable.size
    share = float(np.mean(chart.stable))
    print_text(f"{cells} cells, {100 * share:.1f} % stable")
    for curve in curves[:SHOWN_CURVES]:
        ends = f"{curve.omega.min():.4g} to {curve.omega.max():.4g} rad/s"
        print_text(f"boundary of {len(curve)} points, omega {ends}")
    if len(curves) > SHOWN_CURVES:
        print_text(f"and {len(curves) - SHOWN_CURVES} shorter boundaries")
    if best is not None:
        gains = ", ".join(f"{name} = {value:.4g}" for name, value in best.items())
        further = "infinite" if margin == np.inf else f"{margin:.4g} s"
        print_text(
            f"most stable cell: {gains} with spectral abscissa {abscissa:.4g} 1/s and delay "
            f"margin {further}",
            wrapped=False,
        )
    if crossed is not None:
        print_table(_crossings_table(crossed))


def _attributes(found: object, *names: str) -> dict[str, object]:
    return {name: getattr(found, name) for name in names}


def _crossings_along(
    loop: ControlLoop,
    along: Gains,
    at: float | None,
    best: dict[str, float] | None,
    axes: Mapping[str, np.ndarray],
) -> Crossings:
    """Crossings along one gain within its range, at a value of the other gain."""
    other = "Kv" if along == "Kp" else "Kp"
    if at is None:
        if best is None:
            raise ValueError(
                f"--along {along}: the value of the other gain is missing, and no best cell is "
                "known as its default. Give --at"
            )
        at = best[other]
    ends = (float(axes[along][0]), float(axes[along][-1]))
    return crossings(loop, {along: ends}, at={other: at})


def _crossings_table(crossed: Crossings) -> Table:
    heads = (crossed.parameter, "omega / (rad/s)", "become unstable", "unstable above")
    places = zip(crossed.values, crossed.omega, crossed.direction, strict=True)
    rows = [
        (float(value), f"{value:.10g}", f"{omega:.6g}", f"{direction:+d}" if direction else "?")
        for value, omega, direction in places
    ]
    edges = {edge for gap in crossed.unlisted for edge in gap} - set(crossed.range)
    rows += [(edge, f"{edge:.6g}", "", "") for edge in edges]
    low = crossed.range[0]
    rows = [(low, f"{low:.6g}", "", ""), *sorted(rows)]
    counted_rows = zip(rows, crossed.counts, strict=True)
    return results_table(heads, [(*shown, _unstable(count)) for (_, *shown), count in counted_rows])


def _unstable(count: int) -> str:
    return str(count) if count >= 0 else "not listed" if count == -1 else "?"
