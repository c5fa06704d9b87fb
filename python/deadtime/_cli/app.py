"""The commands: each reads its options, calls the library once, and shows what came out."""

from __future__ import annotations

import csv
import os
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer
from rich import box
from rich.table import Table

from deadtime._cli import options as opt
from deadtime._cli.show import (
    console,
    counted,
    estimates_table,
    print_json,
    print_table,
    save_figure,
    stages,
)
from deadtime._crossings import Crossings, crossings, delay_margin
from deadtime._design import design as find_design
from deadtime._errors import DeadtimeError
from deadtime._estimation import estimate_delay
from deadtime._estimation.compare import compare_methods
from deadtime._experiment import demo_flight, study
from deadtime._loop import ControlLoop
from deadtime._plots import (
    new_figure,
    plot_certificate,
    plot_estimate,
    plot_fits,
    plot_responses,
    plot_root_set,
)
from deadtime._readers import read_recording
from deadtime._recording import Recording
from deadtime._report import write_report
from deadtime._rootset import RootSet
from deadtime._stability import stability_map

__all__ = ["app", "run"]

app = typer.Typer(
    name="deadtime",
    help="Control loops with a delay in them: estimate it, map the gains, design for it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Method = Literal["all", "overshoot", "waveform"]
Map = Literal["dominant", "exact", "saturated"]
Objective = Literal["abscissa", "settling_time"]
Ends = tuple[float, float]
Proof = Literal["curves", "cells"]
Gains = Literal["Kp", "Kv"]

#: Boundaries of a map that are described.
SHOWN_CURVES = 4


#: What ends a command with one line; anything else is a defect and shows where it is.
FAILURES = (
    DeadtimeError,
    ArithmeticError,
    ImportError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)


#: Exit code after Ctrl-C.
INTERRUPTED = 130


def run() -> None:
    """Run the command; a failure is one line on standard error and a non-zero exit."""
    try:
        app()
    except SystemExit as ended:
        if ended.code == INTERRUPTED:  # typer says nothing when it ends so
            raise KeyboardInterrupt from None
        raise
    except BrokenPipeError:  # whoever read the output has had enough of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None
    except FAILURES as error:
        told = str(error)
        if isinstance(error, OSError) and error.filename is not None:
            told = f"{error.filename}: {error.strerror}"
        elif isinstance(error, ArithmeticError):
            told = f"a number leaves the range of double precision ({told}): choose other units"
        elif isinstance(error, MemoryError):
            told = "out of memory: ask for less at once"
        print(f"deadtime: {' '.join(told.split())}", file=sys.stderr)
        raise SystemExit(1) from None


@app.command()
def estimate(
    file: opt.File,
    kp: opt.Kp,
    time: opt.Time = "time",
    reference: opt.Reference = "reference",
    output: opt.Output = "output",
    command: opt.Command = None,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    gain: opt.Gain = 1.0,
    window: opt.Window = None,
    method: Annotated[Method, typer.Option(help="One method, or all beside each other.")] = "all",
    map: Annotated[  # noqa: A002
        Map, typer.Option(help="From overshoot to delay, for --method overshoot.")
    ] = "dominant",
    free: Annotated[
        str, typer.Option(help="What --method waveform fits: of delay, gain, lag.")
    ] = "delay,gain",
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Estimate the delay of a loop from a recording of its step response."""
    recording = read_recording(file, time=time, reference=reference, output=output, command=command)
    loop = opt.described_loop(kp, gain=gain, sample_time=sample_time, limit=limit)
    if method == "all":
        _estimate_all(recording, loop, window, plot, as_json)
        return
    if method == "overshoot":
        fit = estimate_delay(recording, loop, method="overshoot", map=map, window=window)
    else:
        names = [name.strip() for name in free.split(",") if name.strip()]
        fit = estimate_delay(recording, loop, method="waveform", free=names, window=window)
    if plot is not None:
        save_figure(plot_estimate(fit), plot)
    if as_json:
        print_json(fit.to_dict())
    else:
        console.print(fit.summary(), highlight=False, markup=False, soft_wrap=True)


def _estimate_all(
    recording: Recording,
    loop: ControlLoop,
    window: Ends | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    comparison = compare_methods(recording, loop, window)
    if plot is not None:
        figure, axes = new_figure(7.5, 4.0)
        plot_fits(axes, comparison.best.recording, comparison.estimates)
        save_figure(figure, plot)
    if as_json:
        print_json(
            {
                "estimates": {name: fit.to_dict() for name, fit in comparison.estimates.items()},
                "refusals": comparison.refusals,
                "explanation": comparison.explanation(),
            }
        )
        return
    print_table(estimates_table(comparison))
    console.print("in brackets: taken as given; sum: delay and lag", style="dim")
    for sentence in comparison.explanation():
        console.print(f"• {sentence}", highlight=False, markup=False)


@app.command()
def roots(
    kp: opt.Kp,
    delay: opt.Delay,
    kv: opt.Kv = 0.0,
    gain: opt.Gain = 1.0,
    lag: opt.Lag = 0.0,
    sample_time: opt.Sample_time = None,
    filter: opt.Filter = None,  # noqa: A002
    re: Annotated[Ends | None, typer.Option(help="Region: real parts, 1/s.")] = None,
    im: Annotated[Ends | None, typer.Option(help="Region: imaginary parts, rad/s.")] = None,
    rightmost: Annotated[int, typer.Option(min=1, help="How many, without a region.")] = 3,
    plot: opt.Plot = None,
    certificate: Annotated[
        Path | None,
        typer.Option(help="File the proof of their number as JSON; with --plot, draw it, too."),
    ] = None,
    as_json: opt.As_json = False,
) -> None:
    """Characteristic roots of a loop: the rightmost ones, or all in a region."""
    loop = opt.described_loop(
        kp, kv, delay=delay, gain=gain, lag=lag, sample_time=sample_time, corner=filter
    )
    if (re is None) != (im is None):
        raise ValueError("a region needs both --re and --im")
    if re is None or im is None:
        found = loop.rightmost(rightmost)
    else:
        found = loop.characteristic().roots(re=re, im=im)
    chain = -np.inf if loop.is_sampled else loop.characteristic().chain_abscissa()
    proof = None
    if certificate is not None:
        # Of a sampled loop there is no contour: `characteristic` says so.
        reals, heights = found.region
        proof = loop.characteristic().certify(reals, heights)
        certificate.write_text(proof.to_json(indent=1), encoding="utf-8")
    if plot is not None:
        figure, axes = new_figure(6.0, 4.5)
        if proof is not None:
            plot_certificate(axes, proof)
        chains = () if loop.is_sampled else loop.characteristic().chains()
        plot_root_set(axes, found, chains)
        save_figure(figure, plot)
    if as_json:
        print_json(
            {
                "roots": [complex(root) for root in found.roots],
                "multiplicities": found.multiplicities,
                "radii": found.radii,
                "counted": found.counted,
                "chain_abscissa": chain,
                "spectral_abscissa": loop.spectral_abscissa(),
                "stable": loop.is_stable(),
            }
        )
        return
    print_table(_roots_table(found))
    if np.isfinite(chain):
        console.print(f"neutral: a chain of roots approaches Re s = {chain:.6g}", highlight=False)
    state = "stable" if loop.is_stable() else "unstable"
    console.print(f"spectral abscissa {loop.spectral_abscissa():.6g} 1/s: {state}", highlight=False)


def _roots_table(found: RootSet) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    for head in ("Re s / (1/s)", "Im s / (rad/s)", "multiplicity", "disc radius"):
        table.add_column(head, justify="right")
    for root, multiplicity, radius in zip(
        found.roots, found.multiplicities, found.radii, strict=True
    ):
        table.add_row(f"{root.real:.10g}", f"{root.imag:.10g}", str(multiplicity), f"{radius:.1e}")
    return table


@app.command("map")
def map_(
    delay: opt.Delay,
    kp: Annotated[Ends, typer.Option(help="Range of the proportional gain.")] = (0.0, 6.0),
    kv: Annotated[Ends, typer.Option(help="Range of the velocity gain.")] = (-1.0, 1.0),
    gain: opt.Gain = 1.0,
    lag: opt.Lag = 0.0,
    sample_time: opt.Sample_time = None,
    filter: opt.Filter = None,  # noqa: A002
    shape: Annotated[tuple[int, int], typer.Option(help="Cells along each axis.")] = (121, 121),
    counts: Annotated[
        bool, typer.Option("--counts", help="Count unstable roots only: a fraction of the time.")
    ] = False,
    decay: Annotated[
        float, typer.Option(help="Stable: every root decays at least so fast, 1/s.")
    ] = 0.0,
    damping: Annotated[
        Ends | None,
        typer.Option(help="And: least damping ratio, of roots that decay slower than so many 1/s."),
    ] = None,
    proof: Annotated[
        Proof, typer.Option(help="Prove whole rows by their crossings, or every cell alone.")
    ] = "curves",
    along: Annotated[
        Gains | None, typer.Option(help="List the crossings of the axis along this gain.")
    ] = None,
    at: Annotated[
        float | None, typer.Option(help="The other gain there. Without: that of the best cell.")
    ] = None,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Map which gains of a PV controller are stable, with the boundary and the best of them."""
    loop = _pv_loop(delay, gain, lag, sample_time, None, filter)
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
    # A sampled loop has no curves.
    curves = () if loop.is_sampled else chart.boundaries
    if plot is not None:
        figure, axes = new_figure(7.0, 4.5)
        chart.plot(axes, best)
        save_figure(figure, plot)
    if as_json:
        print_json(
            {
                "axes": chart.axes,
                "unstable": chart.unstable,
                "abscissa": None if counts and not loop.is_sampled else chart.abscissa,
                "status": chart.status,
                "boundaries": [
                    {
                        **curve.values,
                        "omega": curve.omega,
                        "crossing": curve.crossing,
                        "along": curve.along,
                    }
                    for curve in curves
                ],
                "best": best,
                "best_abscissa": abscissa,
                "best_delay_margin": margin,
                "crossings": None
                if crossed is None
                else {
                    "parameter": crossed.parameter,
                    "values": crossed.values,
                    "omega": crossed.omega,
                    "direction": crossed.direction,
                    "counts": crossed.counts,
                },
            }
        )
        return
    cells = chart.stable.size
    share = float(np.mean(chart.stable))
    console.print(f"{cells} cells, {100 * share:.1f} % stable", highlight=False)
    for curve in curves[:SHOWN_CURVES]:
        ends = f"{curve.omega.min():.4g} to {curve.omega.max():.4g} rad/s"
        console.print(f"boundary of {len(curve)} points, omega {ends}", highlight=False)
    if len(curves) > SHOWN_CURVES:
        console.print(f"and {len(curves) - SHOWN_CURVES} shorter boundaries", highlight=False)
    if best is not None:
        gains = ", ".join(f"{name} = {value:.4g}" for name, value in best.items())
        bears = "any further delay" if margin == np.inf else f"{margin:.4g} s more delay"
        console.print(
            f"most stable cell: {gains}, spectral abscissa {abscissa:.4g} 1/s; it bears {bears}",
            highlight=False,
            soft_wrap=True,
        )
    if crossed is not None:
        print_table(_crossings_table(crossed))


def _crossings_along(
    loop: ControlLoop,
    along: Gains,
    at: float | None,
    best: dict[str, float] | None,
    axes: Mapping[str, np.ndarray],
) -> Crossings:
    """Crossings along one gain within its range, the other one at `at` or that of the best cell."""
    other = "Kv" if along == "Kp" else "Kp"
    if at is None:
        if best is None:
            raise ValueError(f"--along {along} needs --at: no cell is known to be the best")
        at = best[other]
    ends = (float(axes[along][0]), float(axes[along][-1]))
    return crossings(loop, {along: ends}, at={other: at})


def _crossings_table(crossed: Crossings) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    heads = (crossed.parameter, "omega / (rad/s)", "become unstable", "unstable above")
    for head in heads:
        table.add_column(head, justify="right")
    low = crossed.range[0]
    table.add_row(f"{low:.6g}", "", "", _told(crossed.counts[0]))
    for value, omega, direction, count in zip(
        crossed.values, crossed.omega, crossed.direction, crossed.counts[1:], strict=True
    ):
        moved = f"{direction:+d}" if direction else "?"
        table.add_row(f"{value:.10g}", f"{omega:.6g}", moved, _told(count))
    return table


def _told(count: int) -> str:
    return str(count) if count >= 0 else "?"


def _pv_loop(
    delay: float | None,
    gain: float,
    lag: float,
    sample_time: float | None,
    limit: float | None,
    corner: float | None,
) -> ControlLoop:
    return opt.described_loop(
        1.0,
        0.1,
        delay=delay,
        gain=gain,
        lag=lag,
        sample_time=sample_time,
        limit=limit,
        corner=corner,
    )


@app.command()
def design(
    delay: opt.Delay,
    delay_to: Annotated[
        float | None, typer.Option(help="Upper end of the delay, if it is an interval, s.")
    ] = None,
    kp: Annotated[Ends | None, typer.Option(help="Range of the proportional gain.")] = None,
    kv: Annotated[Ends | None, typer.Option(help="Range of the velocity gain.")] = None,
    gain: opt.Gain = 1.0,
    lag: opt.Lag = 0.0,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    filter: opt.Filter = None,  # noqa: A002
    objective: Annotated[Objective, typer.Option(help="What to make small.")] = "abscissa",
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Find PV gains: the most stable on the map, or the fastest to settle."""
    loop = _pv_loop(delay, gain, lag, sample_time, limit, filter)
    if (kp is None) != (kv is None):
        raise ValueError("give both --kp and --kv, or neither")
    opt.check_duration(loop if delay_to is None else loop.replace(delay=delay_to))
    with stages(1, quiet=as_json) as begin:
        begin("mapping and searching")
        found = find_design(
            loop,
            controller=loop.controller,
            delay=delay if delay_to is None else (delay, delay_to),
            objective=objective,
            ranges=None if kp is None or kv is None else {"Kp": kp, "Kv": kv},
        )
    response = found.loop.step_response()
    if plot is not None:
        figure, axes = new_figure(7.0, 4.5)
        found.charts[len(found.charts) // 2].plot(axes, found.gains)
        save_figure(figure, plot)
    if as_json:
        print_json(
            {
                "gains": found.gains,
                "abscissa": found.abscissa,
                "delays": found.delays,
                "objective": found.objective,
                "value": found.value,
                "step": response.info(),
            }
        )
        return
    gains = ", ".join(f"{name} = {value:.4g}" for name, value in found.gains.items())
    info = response.info()
    console.print(
        f"{gains}: spectral abscissa {found.abscissa:.4g} 1/s, settles in "
        f"{info['settling_time']:.3g} s, overshoot {info['overshoot']:.2g} %",
        highlight=False,
    )


@app.command()
def simulate(
    kp: opt.Kp,
    delay: opt.Delay,
    kv: opt.Kv = 0.0,
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
        kp,
        kv,
        delay=delay,
        gain=gain,
        lag=lag,
        sample_time=sample_time,
        limit=limit,
        corner=filter,
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
    if as_json:
        print_json(
            {
                "time": response.time,
                "output": response.outputs,
                "command": response.inputs,
                "info": response.info(),
            }
        )
        return
    for name, value in response.info().items():
        shown = f"{value:.6g}" if np.isfinite(value) else "never, or not defined"
        console.print(f"{name.replace('_', ' '):<20}{shown}", highlight=False)


@app.command()
def report(
    file: opt.File,
    kp: opt.Kp,
    time: opt.Time = "time",
    reference: opt.Reference = "reference",
    output: opt.Output = "output",
    command: opt.Command = None,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    gain: opt.Gain = 1.0,
    window: opt.Window = None,
    out: Annotated[Path, typer.Option(help="The page to write.")] = Path("report.html"),
    as_json: opt.As_json = False,
) -> None:
    """Write one page about a recording: delay, map of gains, a controller to try."""
    recording = read_recording(file, time=time, reference=reference, output=output, command=command)
    loop = opt.described_loop(kp, gain=gain, sample_time=sample_time, limit=limit)
    with stages(5, quiet=as_json) as begin:
        found = study(recording, loop, window=window, progress=begin)
    write_report(found, out)
    if as_json:
        print_json({"verdict": found.verdict(), "report": out, "gains": found.designed.gains})
        return
    console.print(found.verdict(), highlight=False, markup=False)
    console.print(f"report: {out}", highlight=False, markup=False)


@app.command()
def demo(
    folder: Annotated[Path, typer.Option(help="Where to write.")] = Path("demo"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sensor noise.")] = 1,
    as_json: opt.As_json = False,
) -> None:
    """Fly a simulated loop with known truth and find its delay and its gains; no hardware."""
    with stages(6, quiet=as_json) as begin:
        begin("flying the simulated loop")
        flight = demo_flight(seed)
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "flight.csv"
        _write_flight(flight.recording, file)
        found = study(
            flight.recording, flight.known, window=flight.window, truth=flight, progress=begin
        )
    page = write_report(found, folder / "report.html")
    if as_json:
        print_json(
            {
                "truth": flight.numbers,
                "estimates": {
                    name: fit.to_dict() for name, fit in found.comparison.estimates.items()
                },
                "gains": found.designed.gains,
                "verdict": found.verdict(),
                "flight": file,
                "report": page,
            }
        )
        return
    print_table(estimates_table(found.comparison, flight.numbers))
    for sentence in found.comparison.explanation():
        console.print(f"• {sentence}", highlight=False, markup=False)
    console.print()
    console.print(found.verdict(), highlight=False, markup=False, style="bold")
    console.print(f"\nThe flight is in {file}, the report in {page}. To go on:", highlight=False)
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


def _next_commands(loop: ControlLoop, window: Ends, file: Path, fit: object) -> list[str]:
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
