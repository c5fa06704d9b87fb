"""``deadtime estimate``: the plant of a recording, or the delay of a loop in one or several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from deadtime._base.drawing import empty_figure, new_figure
from deadtime._cli import options as opt
from deadtime._cli.checks import grave_findings, print_grave_findings, show_checks
from deadtime._cli.comparisons import choice_table, estimates_table
from deadtime._cli.estimate_plant import Asked, estimate_plant
from deadtime._cli.fits import print_details, print_headline
from deadtime._cli.free import check_fitted, checked_free
from deadtime._cli.plants import with_names
from deadtime._cli.show import print_json, print_points, print_table, print_text, save_figure
from deadtime._cli.windows import files_and_windows
from deadtime.estimation import (
    JOINT,
    METHODS,
    Comparison,
    DelayEstimate,
    Method,
    NoisePath,
    OvershootMap,
    PlantChoice,
    automatic_method,
    choose_plant,
    compare_methods,
    estimate_axes,
    estimate_delay,
    plot_estimate,
    plot_fits,
)
from deadtime.recordings import read_recording

Each = TypeVar("Each")

#: What the number of lags is chosen for, and a plant that integrates or does not likewise.
AUTOMATIC = {"auto": "1/(s+1)", "auto/s": "1/s"}

CHOICES = ("all", "auto", *METHODS)


def command(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Tables of one vehicle: CSV with a header line, Parquet, Arrow or MAT. "
            "FILE@LOW:HIGH is a file with a window of its own.",
            show_default=False,
        ),
    ],
    kp: Annotated[
        list[float] | None,
        typer.Option(
            help="Proportional gain of the controller in the loop. This and the other gains: one, "
            "or one for each file. Without: the plant is found from command and output alone.",
            show_default=False,
        ),
    ] = None,
    kv: Annotated[
        list[float] | None, typer.Option(help="Velocity gain, of PV.", show_default=False)
    ] = None,
    ki: Annotated[
        list[float] | None, typer.Option(help="Integral gain, of PI and PID.", show_default=False)
    ] = None,
    kd: Annotated[
        list[float] | None, typer.Option(help="Derivative gain, of PD and PID.", show_default=False)
    ] = None,
    filter: opt.Filter = None,  # noqa: A002
    time: opt.Time = None,
    reference: opt.Reference = None,
    output: opt.Output = None,
    command: opt.Command = None,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    plant: Annotated[
        str | None,
        typer.Option(
            help="Plant in place of the integrator, such as '0.9/(s*(0.1*s+1))'; delay(T) in it is "
            "a delay of T s, added to that of the loop. auto/s: an integrator with as many lags as "
            "the recording shows; auto: the same without an integrator. Without --kp: a kind, such "
            "as 'two lags'."
        ),
    ] = None,
    gain: opt.Gain = 1.0,
    window: opt.Window = None,
    method: Annotated[
        str | None,
        typer.Option(
            help=f"{', '.join(CHOICES)}. Without: all beside each other, for several files auto.",
            show_default=False,
        ),
    ] = None,
    free: Annotated[
        str | None,
        typer.Option(
            help="What is fitted, for one method: of delay, gain, lag of an integrator, "
            "time_constant of a first-order plant, lag_1, lag_2, … and zero of one of more real "
            "poles; for waveform also limit and start. Without: delay,gain.",
            show_default=False,
        ),
    ] = None,
    map: Annotated[  # noqa: A002
        OvershootMap | None, typer.Option(help="From overshoot to delay, for overshoot.")
    ] = None,
    noise: Annotated[
        NoisePath | None,
        typer.Option(help="Where sensor noise goes, for waveform: round the loop or not."),
    ] = None,
    initial_output: Annotated[
        float | None,
        typer.Option(
            help="True output at the start, if known; for output_error, waveform, grid, cta."
        ),
    ] = None,
    at_rest: Annotated[
        bool | None,
        typer.Option(
            "--at-rest/--not-at-rest",
            help="Without --kp: was the plant at rest at the first row? Not given: as it shows.",
            show_default=False,
        ),
    ] = None,
    closed_loop: Annotated[
        bool | None,
        typer.Option(
            "--closed-loop/--open-loop",
            help="Without --kp: does a controller compute the command? Not given: a reference that "
            "moves says so.",
            show_default=False,
        ),
    ] = None,
    largest_delay: Annotated[
        float | None, typer.Option(help="Without --kp: largest delay that is tried, s.")
    ] = None,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Estimate nothing: print what a check of the files finds. The exit code is 1 if "
            "it refuses one.",
        ),
    ] = False,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Find the plant of a recording, or the delay of a known loop, with a verdict."""
    files, windows = files_and_windows(files, window)
    columns: dict[str, Any] = {
        "time": time,
        "reference": reference,
        "output": output,
        "command": command,
    }
    known = {"at_rest": at_rest, "closed_loop": closed_loop, "largest_delay": largest_delay}
    if kp is None:
        loops_only = {
            "kv": kv, "ki": ki, "kd": kd, "filter": filter, "sample_time": sample_time,
            "limit": limit, "method": method, "free": free, "map": map, "noise": noise,
            "initial_output": initial_output, "check": check or None,
        }  # fmt: skip
        _refuse_given(loops_only, "is for a loop whose controller is named: give --kp, or leave it")
        columns["command"] = command or "auto"
        asked = Asked(files, columns, windows, {**known, "plant": plant}, plot)
        estimate_plant(asked, as_json)
        return
    _refuse_given(known, "is for a recording without a named controller: leave it or --kp out")
    given = {"map": map, "noise": noise, "initial_output": initial_output}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if plant in AUTOMATIC and method is None:
        method = "auto"
    name = _chosen(method, len(files), options)
    if filter is not None and kv is None and kd is None:
        raise ValueError("--filter is for the derivative: give --kv or --kd, or leave it out")
    gains = zip(
        _each("kp", kp, files),
        _each("kv", kv or [0.0], files),
        _each("ki", ki or [0.0], files),
        _each("kd", kd or [0.0], files),
        strict=True,
    )
    loops = [
        opt.described_loop(
            Kp,
            Kv,
            gain=gain,
            ki=Ki,
            kd=Kd,
            sample_time=sample_time,
            limit=limit,
            corner=filter,
            plant=AUTOMATIC.get(plant or "", plant),
        )
        for Kp, Kv, Ki, Kd in gains
    ]
    loops = [loop.replace(plant=with_names(loop.plant)) for loop in loops]
    flights = [read_recording(file, **columns) for file in files]
    if name == "auto":
        name = automatic_method(flights)
    fitted = checked_free(free, loops[0], name)
    checks = [
        flight.check(loop, ends) for flight, loop, ends in zip(flights, loops, windows, strict=True)
    ]
    if check:
        show_checks(files, checks, as_json)
        raise typer.Exit(1 if any(one.refused for one in checks) else 0)
    findings = grave_findings(files, checks)
    if plant in AUTOMATIC:
        if free is not None or name == "all":
            raise ValueError(
                f"--plant {plant} fits every number of a plant by one method: leave out --free, "
                "and name --method output_error or waveform, or auto"
            )
        choice = choose_plant(flights, loops, method=_with_options(name, options), window=windows)
        _show_choice(choice, findings, plot, as_json)
        return
    if name == "all":
        if free is not None:
            raise ValueError("--free is for one method: name it by --method")
        _show_all(compare_methods(flights[0], loops[0], windows[0]), findings, plot, as_json)
        return
    fit = estimate_delay(
        flights,
        loops,
        method=_with_options(name, options),
        free=fitted,
        window=windows,
    )
    if free is not None:
        check_fitted(fitted, fit)
    if plot is not None:
        _draw(fit, plot)
    if as_json:
        print_json("estimate", fit.to_dict() | {"findings": findings})
    else:
        print_headline(fit)
        print_grave_findings(findings)
        print_details(fit)


def _refuse_given(options: dict[str, Any], why: str) -> None:
    """Refuse options of the other way to estimate."""
    for name, value in options.items():
        if value is not None:
            raise ValueError(f"--{name.replace('_', '-')} {why}")


def _each(name: str, values: Sequence[Each], files: Sequence[Path]) -> list[Each]:
    """A value for each file, of one for all or of one each."""
    if len(values) not in (1, len(files)):
        raise ValueError(
            f"{len(files)} {'file' if len(files) == 1 else 'files'} and {len(values)} of --{name}: "
            "give one for all, or one for each"
        )
    return list(values) * (len(files) if len(values) == 1 else 1)


def _chosen(method: str | None, number: int, options: dict[str, Any]) -> str:
    """The method, checked against the number of files and the options."""
    if method is None:
        method = "all" if number == 1 else "auto"
    if method not in CHOICES:
        raise ValueError(f"--method {method} is not one of {', '.join(CHOICES)}")
    if method == "all" and number > 1:
        raise ValueError(
            f"--method all compares methods on one file, these are {number}: fit them together by "
            f"--method {' or '.join(JOINT)}"
        )
    if method == "all" and options:
        option = next(iter(options)).replace("_", "-")
        raise ValueError(f"--{option} is for one method: name it by --method")
    return method


def _with_options(name: str, options: dict[str, Any]) -> Method:
    """The method with the options of the command line, refused where it does not have them."""
    known = [field.name for field in fields(METHODS[name])]
    for option in options:
        if option not in known:
            raise ValueError(f"--{option.replace('_', '-')} is not an option of --method {name}")
    return METHODS[name](**options)


def _show_choice(
    choice: PlantChoice, findings: list[dict[str, Any]], plot: Path | None, as_json: bool
) -> None:
    if plot is not None:
        _draw(choice.best, plot)
    if as_json:
        print_json("plant-choice", choice.to_dict() | {"findings": findings})
        return
    print_headline(choice.best)
    print_grave_findings(findings)
    print_table(choice_table(choice))
    print_points(choice.remarks())
    print_details(choice.best)


def _draw(fit: DelayEstimate, plot: Path) -> None:
    figure = empty_figure(7.0 + 3.5 * len(fit.runs), 4.6)
    plot_estimate(fit, estimate_axes(fit, figure))
    save_figure(figure, plot)


def _show_all(
    comparison: Comparison, findings: list[dict[str, Any]], plot: Path | None, as_json: bool
) -> None:
    if plot is not None:
        figure, axes = new_figure(7.5, 4.0)
        plot_fits(axes, comparison.best.recording, comparison.pictured())
        save_figure(figure, plot)
    if as_json:
        print_json(
            "comparison",
            {
                "estimates": {name: fit.to_dict() for name, fit in comparison.estimates.items()},
                "refusals": comparison.refusals,
                "differences": {
                    name: asdict(one) for name, one in comparison.differences().items()
                },
                "explanation": comparison.explanation(),
                "findings": findings,
            },
        )
        return
    print_headline(comparison.best)
    print_grave_findings(findings)
    print_table(estimates_table(comparison))
    print_text(
        f"in brackets: taken as given; sum: delay and lag; off: sum less that of "
        f"{comparison.best.method}, in s and in its standard errors",
        "dim",
    )
    print_points([*comparison.explanation(), *comparison.limitations()])
