"""``deadtime estimate`` without a controller: the plant that a recording shows."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from deadtime._base.drawing import new_figure
from deadtime._base.validation import OpenRange
from deadtime._cli.show import print_json, print_text, save_figure, stages
from deadtime.estimation import PLANTS, PlantEstimate, estimate_delay
from deadtime.recordings import read_recording

#: Exit code where the recording does not determine what was asked.
NOT_TOLD = 3


@dataclass(frozen=True)
class Asked:
    """What the command line says of a recording without a controller."""

    files: Sequence[Path]
    columns: Mapping[str, Any]
    windows: Sequence[OpenRange | None]
    known: Mapping[str, Any]
    plot: Path | None

    def again(self, more: Mapping[str, Any] | None = None, plot: str | None = None) -> str:
        """The command that asks this, with more options."""
        options = {**self.known, **(more or {})}
        window = options.pop("window", None)
        windows = self.windows if window is None else [window] * len(self.files)
        words: list[object] = ["deadtime", "estimate"]
        for file, given in zip(self.files, windows, strict=True):
            ends = ":".join("" if end is None else f"{end:.10g}" for end in given or ())
            words.append(f"{file}@{ends}" if ends else file)
        for name, column in self.columns.items():
            if column is not None and column != "auto":
                words += [f"--{name}", column]
        for name, value in options.items():
            words += _option(name, value)
        if plot is not None:
            words += ["--plot", plot]
        return shlex.join(map(str, words))


def _option(name: str, value: Any) -> list[object]:
    if value is None:
        return []
    if name == "closed_loop":
        return ["--closed-loop" if value else "--open-loop"]
    if name == "at_rest":
        return ["--at-rest" if value else "--not-at-rest"]
    return [f"--{name.replace('_', '-')}", f"{value:g}" if isinstance(value, float) else value]


def estimate_plant(asked: Asked, as_json: bool) -> None:
    """Print the verdict, the plant, its numbers, what came second and what to do next."""
    plant = asked.known.get("plant")
    if plant is not None and plant not in PLANTS:
        raise ValueError(
            f"--plant {plant}: without --kp it is one of {', '.join(map(repr, PLANTS))}; a formula "
            "needs --kp"
        )
    recordings = [read_recording(file, **asked.columns) for file in asked.files]
    with stages(1, quiet=as_json) as begin:
        begin("comparing plants")
        fit = estimate_delay(recordings, window=list(asked.windows), **asked.known)
    if asked.plot is not None:
        figure, axes = new_figure(7.0, 4.6, rows=2)
        fit.plot(axes)
        save_figure(figure, asked.plot)
    following = next_command(fit, asked)
    if as_json:
        print_json("plant-estimate", fit.to_dict() | {"next": following})
    else:
        _print(fit, following)
    if fit.verdict == "none":
        raise typer.Exit(NOT_TOLD)


def _print(fit: PlantEstimate, following: str) -> None:
    first, *rest = fit.lines()
    print_text(first, "bold" if fit.verdict == "reliable" else "yellow")
    print_text("\n".join(f"  {line}" for line in rest), wrapped=False)
    print_text(f"next: {fit.advice().words}", wrapped=False)
    if following:
        print_text(f"  {following}", wrapped=False)


def next_command(fit: PlantEstimate, asked: Asked) -> str:
    """The command that does what is advised; empty where another recording is needed."""
    advice = fit.advice()
    if advice.controller:
        return _design(fit, advice.controller)
    if advice.options:
        return asked.again(advice.options)
    return asked.again(plot=f"{asked.files[0].stem}.png") if advice.draw else ""


def _design(fit: PlantEstimate, controller: str) -> str:
    """The command that finds gains for the whole interval of the dead time."""
    low, high = fit.intervals["delay"]
    words: Sequence[str] = (
        *("deadtime", "design", "--controller", controller, f"--plant={fit.best.formula()}"),
        *("--delay", f"{low:.4g}", "--delay-to", f"{high:.4g}"),
    )
    return shlex.join(words)
