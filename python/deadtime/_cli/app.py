"""The commands: each reads its options, calls the library once, and shows what came out."""

from __future__ import annotations

import csv
import os
import shlex
import sys
import traceback
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich import box
from rich.table import Table

from deadtime._base.drawing import check_matplotlib, new_figure
from deadtime._base.errors import DeadtimeError
from deadtime._cli import options as opt
from deadtime._cli.designs import design_gains
from deadtime._cli.emulate import emulators
from deadtime._cli.estimates import estimate_delays
from deadtime._cli.fly import fly_drone
from deadtime._cli.internet_loop import run_loop
from deadtime._cli.maps import map_gains
from deadtime._cli.reproduce import reproduce_paper
from deadtime._cli.show import (
    console,
    estimates_table,
    print_json,
    print_table,
    save_figure,
    stages,
)
from deadtime._cli.verdicts import listed, verdict
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording, read_recording
from deadtime.reports import demo_recording, study
from deadtime.reports._page import write_report
from deadtime.roots import RootSet
from deadtime.roots._plots import plot_root_set
from deadtime.roots.certificate._plots import plot_certificate
from deadtime.systems._plots import plot_responses

__all__ = ["app", "run"]

app = typer.Typer(
    name="deadtime",
    help="Control loops with a delay in them: estimate it, map the gains, design for it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Ends = tuple[float, float]

#: What ends a command with one line; anything else is a defect and shows where it is.
FAILURES = (DeadtimeError, ArithmeticError, MemoryError, OSError, ValueError)

#: Exit code after a defect: that of an error within a program, as `sysexits.h` has it.
DEFECT = 70

#: Exit code after Ctrl-C.
INTERRUPTED = 130


def run() -> None:
    """Run the command; a failure is one line on standard error and a non-zero exit.

    What the command does not expect is a defect of its own: it shows where it happened.
    """
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
            told = f"out of memory: {told or 'ask for less at once'}"
        print(f"deadtime: {' '.join(told.split())}", file=sys.stderr)
        raise SystemExit(1) from None
    except Exception as error:
        traceback.print_exc()
        print(
            f"deadtime: the command has failed internally ({type(error).__name__}); this is a "
            "defect, please report it with the lines above and the command",
            file=sys.stderr,
        )
        raise SystemExit(DEFECT) from None


app.command("estimate")(estimate_delays)


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
    rightmost: Annotated[
        int, typer.Option(min=1, help="At most how many of those with Im s >= 0, without a region.")
    ] = 3,
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
                "region": {"re": found.region[0], "im": found.region[1]},
                "chain_abscissa": chain,
                "spectral_abscissa": loop.spectral_abscissa(),
                "stable": loop.is_stable(),
            }
        )
        return
    print_table(_roots_table(found))
    console.print(listed(found, rightmost if re is None else None, chain), highlight=False)
    if np.isfinite(chain):
        console.print(f"neutral: a chain of roots approaches Re s = {chain:.6g}", highlight=False)
    console.print(verdict(loop), highlight=False)


def _roots_table(found: RootSet) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    for head in ("Re s / (1/s)", "Im s / (rad/s)", "multiplicity", "disc radius"):
        table.add_column(head, justify="right")
    for root, multiplicity, radius in zip(
        found.roots, found.multiplicities, found.radii, strict=True
    ):
        table.add_row(f"{root.real:.10g}", f"{root.imag:.10g}", str(multiplicity), f"{radius:.1e}")
    return table


app.command("map")(map_gains)
app.command("design")(design_gains)
app.command("reproduce")(reproduce_paper)
app.command("fly")(fly_drone)
app.command("internet-loop")(run_loop)
app.add_typer(emulators, name="emulate")


#: What a step response has also where it comes to no steady state.
PEAK = ("peak", "peak_time")


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
    stable = loop.is_stable()
    figures = response.info()
    if not stable:
        # Measured against a steady state, to which this loop does not come.
        figures = {name: figures[name] if name in PEAK else np.nan for name in figures}
    if as_json:
        print_json(
            {
                "time": response.time,
                "output": response.outputs,
                "command": response.inputs,
                "stable": stable,
                "info": figures,
            }
        )
        return
    limited = " (without the limit on its command)" if limit is not None else ""
    console.print(f"the loop{limited} is {verdict(loop)}", highlight=False)
    for name, value in figures.items():
        if stable or name in PEAK:
            shown = f"{value:.6g}" if np.isfinite(value) else "not within the time simulated"
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
    check_matplotlib()
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
    check_matplotlib()
    with stages(6, quiet=as_json) as begin:
        begin("flying the simulated loop")
        flight = demo_recording(seed)
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
