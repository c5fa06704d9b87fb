"""`run_internet_loop`: run the paper's Internet loop for several gains and estimate its delay."""

from __future__ import annotations

import asyncio
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from errno import EEXIST
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from deadtime._base.errors import DeadtimeError
from deadtime._base.progress import Stages, stage_report
from deadtime._base.validation import positive
from deadtime.estimation import (
    DelayEstimate,
    Method,
    OutputError,
    Overshoot,
    Waveform,
    estimate_delay,
)
from deadtime.internet._replay import age_error, answer_times, replayed_errors
from deadtime.internet._result import METHODS, InternetLoop, InternetRun
from deadtime.links import virtual_time
from deadtime.links.udp import ENDS, Trial, run_processes, run_trial
from deadtime.loops import ControlLoop, Integrator, P
from deadtime.recordings import Recording, read_recording

#: The gains of the paper's Table 1 whose step responses overshoot, 1/s.
GAINS = (5.0, 6.0, 7.0, 8.0, 9.0, 10.0)

#: Replayed steps for each gain: more make the intervals more accurate and take longer.
REPLAYS = 200

Mode = Literal["virtual", "real", "processes"]


def run_internet_loop(
    trial: Trial,
    gains: Sequence[float] = GAINS,
    *,
    mode: Mode = "virtual",
    folder: Path | None = None,
    methods: Sequence[str] = tuple(METHODS),
    progress: Stages = False,
) -> InternetLoop:
    """Run the loop once for each gain, and estimate the delay from every run.

    Parameters
    ----------
    trial : Trial
        The loop and its network; the gain is replaced. Each run has its own seed, counting
        up from that of the trial.
    gains : sequence of float
        Gains of the controller, 1/s.
    mode : str
        ``"virtual"``: in virtual time, the same for the same seed; ``"real"``: over UDP, in this
        process; ``"processes"``: over UDP, plant, relay and controller in a process each.
    folder : Path, optional
        Where both ends write what they record.
    methods : sequence of str
        How the delay is estimated: ``"dominant"`` (the paper's overshoot), ``"exact"``,
        ``"waveform"``, ``"output_error"``.
    progress : bool or callable
        Called with the name of each stage as it begins; True prints the names on stderr.

    Returns
    -------
    InternetLoop

    Raises
    ------
    LinkError
        When a process does not start, or ends before its time.
    FileExistsError
        When the folder holds recordings of that name already, or is a file.
    OSError
        When the folder cannot be made.
    """
    report = stage_report(progress)
    if not len(gains):
        raise ValueError("gains is empty: give one or more gains")
    trials = [
        replace(trial, gain=positive("gain", gain), seed=trial.seed + index)
        for index, gain in enumerate(gains)
    ]
    if mode not in get_args(Mode):
        raise ValueError(f"mode={mode!r}: give one of {', '.join(get_args(Mode))}")
    unknown = set(methods) - set(METHODS)
    if unknown:
        raise ValueError(
            f"methods {sorted(unknown)} do not exist: give some of {', '.join(METHODS)}"
        )
    stems = [f"{index + 1:02d}-gain-{variant.gain:g}-" for index, variant in enumerate(trials)]
    for file in [] if folder is None else [folder / f"{a}{b}.csv" for a in stems for b in ENDS]:
        if file.exists():  # refused before the first run
            raise FileExistsError(EEXIST, "the file exists already: give another folder", str(file))
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    runs = []
    for variant, stem in zip(trials, stems, strict=True):
        report(f"K = {variant.gain:g}: running")
        reports, recordings = _run(variant, mode, folder, stem)
        report(f"K = {variant.gain:g}: estimating")
        estimates, refusals = _estimate(variant, recordings, methods)
        runs.append(
            InternetRun(
                variant, reports["plant"], reports["controller"], recordings, estimates, refusals
            )
        )
    report("replaying the steps")
    times = np.concatenate([answer_times(run.plant["arrivals"]) for run in runs])
    age = float(np.mean([run.age for run in runs]))
    if not (np.isfinite(times).any() and math.isfinite(age)):
        return InternetLoop(tuple(runs))
    errors = [replayed_errors(run.trial, times, age, REPLAYS, run.trial.seed) for run in runs]
    return InternetLoop(tuple(runs), tuple(errors), age_error(times, trial.sample_time))


def _run(
    trial: Trial, mode: Mode, folder: Path | None, stem: str
) -> tuple[dict[str, dict[str, Any]], dict[str, Recording]]:
    """The report of each end, and its recording."""
    if mode != "processes":
        start = virtual_time.run if mode == "virtual" else asyncio.run
        report = start(run_trial(trial, folder, stem=stem))
        kept = {"plant": report.plant.recording, "controller": report.controller.recording}
        return report.to_dict(), {name: part for name, part in kept.items() if part is not None}
    with tempfile.TemporaryDirectory() as spare:
        place = Path(spare) if folder is None else folder
        reports = run_processes(trial, place, stem=stem)
        recordings = {
            end: read_recording(place / f"{stem}{end}.csv", time="time_s", command="command")
            for end in ENDS
        }
    return reports, recordings


def _estimate(
    trial: Trial, recordings: Mapping[str, Recording], methods: Sequence[str]
) -> tuple[dict[str, DelayEstimate], dict[str, str]]:
    """The delay by every method, and the reasons of those that refused."""
    known = ControlLoop(
        Integrator(gain=trial.plant_gain),
        P(Kp=trial.gain),
        sample_time=trial.sample_time,
        limit=trial.limit,
    )
    estimates: dict[str, DelayEstimate] = {}
    refusals: dict[str, str] = {}
    free = ("delay", "gain") if trial.lag == 0.0 else ("delay", "gain", "lag")
    by_name: dict[str, Method] = {
        "dominant": Overshoot(map="dominant"),
        "exact": Overshoot(map="exact"),
        "waveform": Waveform(),
        "output_error": OutputError(),
    }
    for name in methods:
        end = "controller" if name == "output_error" else "plant"
        if end not in recordings:
            refusals[name] = f"the recording of the {end} is too short"
            continue
        data = recordings[end]
        if end == "plant":
            data = _as_sampled(data, trial.sample_time)
        try:
            estimates[name] = estimate_delay(data, known, method=by_name[name], free=free)
        except DeadtimeError as error:
            refusals[name] = str(error).rstrip(".")
    return estimates, refusals


def _as_sampled(recording: Recording, sample_time: float) -> Recording:
    """Reference and output of the plant on the intended grid of sample times.

    A process wakes up late by less than a sample time, but the simulated loop samples on the grid:
    a step of the reference just after a sample would be taken for one before the next sample. The
    mean lateness is the same for all rows and is kept.
    """
    late = recording.time - sample_time * np.round(recording.time / sample_time)
    time = recording.time - late + float(np.mean(late))
    keep = np.r_[True, np.diff(np.round(time / sample_time)) > 0.5]
    return Recording(
        (time - time[0])[keep],
        recording.reference[keep],
        recording.output[keep],
        source=recording.source,
    )
