"""``deadtime estimate`` without a named plant: the one that a recording shows."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import typer

from deadtime._base.drawing import new_figure
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import OpenRange
from deadtime._cli.checks import grave_findings, print_grave_findings
from deadtime._cli.estimate_loop import NamedLoop
from deadtime._cli.exit_codes import NONE
from deadtime._cli.show import print_json, print_text, save_figure, stages
from deadtime.estimation import PLANTS, PlantEstimate, estimate_delay
from deadtime.loops import P
from deadtime.recordings import Recording, read_recording

#: Rows are the samples of a controller where times between them differ by less than this share.
#: Larger: commands are computed at rows that are no samples; smaller: clocks that differ by a part
#: in a thousand would count.
SAMPLES = 0.05


@dataclass(frozen=True)
class Asked:
    """What the command line says of a recording whose plant is not named."""

    files: Sequence[Path]
    columns: Mapping[str, Any]
    windows: Sequence[OpenRange | None]
    known: Mapping[str, Any]
    plot: Path | None
    loop: NamedLoop

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
            if column is not None:
                words += [f"--{name}", column]
        for name, gains in self.loop.gains.items():
            for gain in gains or ():
                words += _option(name, gain)
        for name in ("sample_time", "limit"):
            words += _option(name, getattr(self.loop, name))
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


def is_answered(loop: NamedLoop) -> bool:
    """Whether the recording is to show the plant: none is named, and the commands are known."""
    if set(loop.named) - {"--plant"}:
        return False
    if loop.gains["kp"] is None:
        return True
    if loop.plant is not None and loop.plant not in PLANTS:
        return False
    if loop.columns["command"] is not None:
        return True
    loops = replace(loop, plant=None).loops()
    if not all(isinstance(model.controller, P) for model in loops):
        return False
    recordings = (read_recording(file, **loop.columns) for file in loop.files)
    return all(_at_samples(recording, loop.sample_time) for recording in recordings)


def _at_samples(recording: Recording, sample_time: float | None) -> bool:
    """Whether the command of a row is the one that its controller computed."""
    if sample_time is None:
        return True
    return abs(recording.sample_time - sample_time) < SAMPLES * sample_time


def estimate_plant(asked: Asked, as_json: bool) -> None:
    """Print the verdict, the plant, its numbers, what came second and what to do next."""
    plant, loop = asked.known.get("plant"), asked.loop
    has_loop = loop.gains["kp"] is not None
    if plant is not None and plant not in PLANTS:
        raise ValueError(
            f"--plant {plant}: without --kp, give one of {', '.join(map(repr, PLANTS))}. With "
            "--kp, a formula such as '0.9/(s*(0.1*s+1))' is possible too"
        )
    columns = dict(asked.columns)
    findings: list[dict[str, Any]] = []
    known = dict(asked.known)
    if has_loop:
        named = replace(loop, plant=None).loops()
        known |= {"controller": [model.controller for model in named], "limit": loop.limit}
        if loop.sample_time is not None:
            known["between"] = "held"
        recordings = [read_recording(file, **columns) for file in asked.files]
        findings = grave_findings(asked.files, loop.checks(recordings, named))
        for finding in findings:
            if finding["severity"] == "refused":
                raise NotIdentifiableError(finding["message"])
    else:
        _refuse_loop(loop)
        columns["command"] = columns["command"] or "auto"
        recordings = [read_recording(file, **columns) for file in asked.files]
    with stages(1, quiet=as_json) as begin:
        begin("comparing plants")
        fit = estimate_delay(recordings, window=list(asked.windows), **known)
    if asked.plot is not None:
        figure, axes = new_figure(7.0, 4.6, rows=2)
        fit.plot(axes)
        save_figure(figure, asked.plot)
    following = next_command(fit, asked)
    if as_json:
        print_json("plant-estimate", fit.to_dict() | {"next": following, "findings": findings})
    else:
        _print(fit, following)
        print_grave_findings(findings)
        if has_loop:
            print_text(f"To compare all methods: {asked.again({'method': 'all'})}", wrapped=False)
    if fit.verdict == "none":
        raise typer.Exit(NONE)


def _refuse_loop(loop: NamedLoop) -> None:
    """Refuse what says something of a controller whose gain is not given."""
    given = {**loop.gains, "filter": loop.corner, "sample_time": loop.sample_time}
    for name, value in {**given, "limit": loop.limit}.items():
        if value is not None:
            raise ValueError(
                f"--{name.replace('_', '-')} can be used only with a known controller: give the "
                f"gain of the controller by --kp, or leave --{name.replace('_', '-')} out"
            )


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
