"""``deadtime estimate`` of a loop with a named plant: one method, all of them, or several files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import typer

from deadtime._base.drawing import empty_figure, new_figure
from deadtime._base.validation import OpenRange
from deadtime._cli import options as opt
from deadtime._cli.checks import grave_findings, print_grave_findings, show_checks
from deadtime._cli.comparisons import choice_table, estimates_table
from deadtime._cli.estimate_options import CHOICES
from deadtime._cli.fits import print_details, print_headline
from deadtime._cli.free import check_fitted, checked_free
from deadtime._cli.plants import with_names
from deadtime._cli.show import print_json, print_points, print_table, print_text, save_figure
from deadtime.estimation import (
    JOINT,
    METHODS,
    Comparison,
    DelayEstimate,
    Method,
    PlantChoice,
    automatic_method,
    choose_plant,
    compare_methods,
    estimate_axes,
    estimate_delay,
    plot_estimate,
    plot_fits,
)
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording, RecordingCheck, read_recording

Each = TypeVar("Each")

#: What the number of lags is chosen for, and a plant that integrates or does not likewise.
AUTOMATIC = {"auto": "1/(s+1)", "auto/s": "1/s"}


@dataclass(frozen=True)
class NamedLoop:
    """What the command line says of files and of the loop that made them."""

    files: list[Path]
    windows: list[OpenRange | None]
    columns: Mapping[str, Any]
    gains: Mapping[str, list[float] | None]
    corner: float | None
    sample_time: float | None
    limit: float | None
    plant: str | None
    gain: float
    method: str | None
    free: str | None
    options: Mapping[str, Any]
    check: bool
    plot: Path | None

    @property
    def named(self) -> list[str]:
        """The options that name a plant, or a method for it."""
        given = {
            "plant": self.plant,
            "gain": None if self.gain == 1.0 else self.gain,
            "method": self.method,
            "free": self.free,
            **self.options,
            "check": self.check or None,
        }
        return [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]

    def loops(self) -> list[ControlLoop]:
        """The loop of each file."""
        if not self.gains["kp"]:
            raise ValueError(
                f"{', '.join(self.named) or 'several files'} can be used only with a known "
                "controller: give the gain of the controller by --kp, or leave this out"
            )
        if self.corner is not None and not (self.gains["kv"] or self.gains["kd"]):
            raise ValueError(
                "--filter is the filter of the derivative, but this controller has no "
                "derivative: give --kv or --kd, or leave --filter out"
            )
        each = (_each(name, own or [0.0], self.files) for name, own in self.gains.items())
        loops = [
            opt.described_loop(
                kp,
                kv,
                gain=self.gain,
                ki=ki,
                kd=kd,
                sample_time=self.sample_time,
                limit=self.limit,
                corner=self.corner,
                plant=AUTOMATIC.get(self.plant or "", self.plant),
            )
            for kp, kv, ki, kd in zip(*each, strict=True)
        ]
        return [loop.replace(plant=with_names(loop.plant)) for loop in loops]

    def checks(
        self, flights: Sequence[Recording], loops: Sequence[ControlLoop]
    ) -> list[RecordingCheck]:
        """What a check of each file finds."""
        each = zip(flights, loops, self.windows, strict=True)
        return [flight.check(loop, ends) for flight, loop, ends in each]


def estimate_loop(asked: NamedLoop, as_json: bool) -> None:
    """Print what the methods say that were asked for."""
    method = "auto" if asked.plant in AUTOMATIC and asked.method is None else asked.method
    name = _chosen(method, len(asked.files), asked.options)
    loops = asked.loops()
    flights = [read_recording(file, **asked.columns) for file in asked.files]
    if name == "auto":
        name = automatic_method(flights)
    fitted = checked_free(asked.free, loops[0], name)
    checks = asked.checks(flights, loops)
    if asked.check:
        show_checks(asked.files, checks, as_json)
        raise typer.Exit(1 if any(check.refused for check in checks) else 0)
    findings = grave_findings(asked.files, checks)
    if asked.plant in AUTOMATIC:
        if asked.free is not None or name == "all":
            raise ValueError(
                f"with --plant {asked.plant}, one method fits all parameters of the plant: leave "
                "out --free, and give --method output_error, waveform or auto"
            )
        own = _with_options(name, asked.options)
        choice = choose_plant(flights, loops, method=own, window=asked.windows)
        _show_choice(choice, findings, asked.plot, as_json)
        return
    if name == "all":
        if asked.free is not None:
            raise ValueError("--free works with one method only: name the method by --method")
        compared = compare_methods(flights[0], loops[0], asked.windows[0])
        _show_all(compared, findings, asked.plot, as_json)
        return
    own = _with_options(name, asked.options)
    fit = estimate_delay(flights, loops, method=own, free=fitted, window=asked.windows)
    if asked.free is not None:
        check_fitted(fitted, fit)
    _show_fit(fit, findings, asked.plot, as_json)


def _show_fit(
    fit: DelayEstimate, findings: list[dict[str, Any]], plot: Path | None, as_json: bool
) -> None:
    if plot is not None:
        _draw(fit, plot)
    if as_json:
        print_json("estimate", fit.to_dict() | {"findings": findings})
        return
    print_headline(fit)
    print_grave_findings(findings)
    print_details(fit)


def _each(name: str, values: Sequence[Each], files: Sequence[Path]) -> list[Each]:
    """A value for each file, of one for all or of one each."""
    if len(values) not in (1, len(files)):
        raise ValueError(
            f"{len(files)} {('file' if len(files) == 1 else 'files')} and {len(values)} values of "
            f"--{name} are given: give one value for all files, or one value for each file"
        )
    return list(values) * (len(files) if len(values) == 1 else 1)


def _chosen(method: str | None, number: int, options: Mapping[str, Any]) -> str:
    """The method, checked against the number of files and the options."""
    if method is None:
        method = "all" if number == 1 else "auto"
    if method not in CHOICES:
        raise ValueError(f"--method {method} is not one of {', '.join(CHOICES)}")
    if method == "all" and number > 1:
        raise ValueError(
            f"--method all compares methods on one file, but {number} files are given: fit the "
            f"files together by --method {' or '.join(JOINT)}"
        )
    if method == "all" and options:
        option = next(iter(options)).replace("_", "-")
        raise ValueError(f"--{option} works with one method only: name the method by --method")
    return method


def _with_options(name: str, options: Mapping[str, Any]) -> Method:
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
                "verdict": comparison.best.verdict,
                "estimates": {name: fit.to_dict() for name, fit in comparison.estimates.items()},
                "refusals": comparison.refusals,
                "differences": {
                    name: asdict(difference)
                    for name, difference in comparison.differences().items()
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
        "Values in brackets are assumed. The column sum has delay plus lag. The column off has "
        f"the difference between this sum and the sum of {comparison.best.method}, in s and in "
        "standard errors.",
        "dim",
    )
    print_points([*comparison.explanation(), *comparison.limitations()])
