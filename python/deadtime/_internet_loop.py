"""The paper's Internet loop from end to end: run it for several gains, estimate, compare.

With constant delays the loop is the sampled `ControlLoop` whose delay is the round trip: it samples
every Ts, and a command holds until the next. What the loop is late by on average is then the age of
the measurement behind the command in force,

    age = round trip + time an answer is held + Ts/2 + wait for what was lost or overtaken,

and it is measured, packet by packet. Methods that know of the hold estimate the age less Ts/2;
the overshoot read as that of a continuous loop has the hold in its delay, too.

A step sees few of the random delays, and what a fit takes for noise is not what makes it miss: its
interval is for the delay that this one step met. How uncertain the mean delay of a network is shows
in how much the runs differ, and better in what the steps would have shown at other moments of the
network as it was measured (`_internet_replay`).
"""

from __future__ import annotations

import asyncio
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from errno import EEXIST
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy import special

from deadtime._controllers import P
from deadtime._errors import DeadtimeError
from deadtime._estimation import DelayEstimate, estimate_delay
from deadtime._internet_replay import (
    MAPS,
    age_error,
    answer_times,
    interval_of_mean,
    replayed_errors,
)
from deadtime._loop import ControlLoop
from deadtime._plants import Integrator
from deadtime._readers import read_recording
from deadtime._recording import Recording
from deadtime._validation import positive
from deadtime.links import virtual_time
from deadtime.links.udp import ENDS, Trial, run_processes, run_trial

__all__ = ["GAINS", "InternetLoop", "InternetRun", "Spread", "run_internet_loop"]

#: The gains of the paper's Table 1 with an overshoot.
GAINS = (5.0, 6.0, 7.0, 8.0, 9.0, 10.0)

#: The methods, and whether they have the hold in what they call the delay.
METHODS = {
    "dominant": True,
    "exact": True,
    "waveform": False,
    "output_error": False,
}

#: Steps that are replayed for each gain.
REPLAYS = 200

#: Part of the sample time by which ages differ where processes just wake up late.
UNSTEADY = 0.3

Mode = Literal["virtual", "real", "processes"]


@dataclass(frozen=True)
class Spread:
    """What several runs say of one delay.

    Attributes
    ----------
    count : int
        Runs with an answer.
    mean : float
        Their mean, s.
    low, high : float
        Interval of 95 % for what was to be found, s: by replaying the steps (`replayed`), or by
        how much the runs differ (Student's t); NaN where neither can be had.
    replayed : bool
        Whether it is by replaying; it then has the error of the method in it.
    """

    count: int
    mean: float
    low: float
    high: float
    replayed: bool = False

    @staticmethod
    def of(values: Sequence[float]) -> Spread:
        """That of these delays."""
        count = len(values)
        if count == 0:
            return Spread(0, math.nan, math.nan, math.nan)
        mean = float(np.mean(values))
        if count == 1:
            return Spread(1, mean, math.nan, math.nan)
        quantile = float(special.stdtrit(count - 1, 0.975))
        half = quantile * float(np.std(values, ddof=1)) / math.sqrt(count)
        return Spread(count, mean, mean - half, mean + half)


@dataclass(frozen=True, eq=False)
class InternetRun:
    """One run of the loop.

    Attributes
    ----------
    trial : Trial
        What was run.
    plant, controller : dict
        What happened at each end, as of `PlantReport.to_dict` and `ControllerReport.to_dict`.
    recordings : dict of str to Recording
        Of the ``plant`` and the ``controller``, by the clock of each.
    estimates : dict of str to DelayEstimate
        By ``dominant`` (the paper's overshoot), ``exact``, ``waveform`` on the plant's recording,
        ``output_error`` on the controller's.
    refusals : dict of str to str
        The methods that could not answer, and why.
    """

    trial: Trial
    plant: Mapping[str, Any]
    controller: Mapping[str, Any]
    recordings: Mapping[str, Recording]
    estimates: Mapping[str, DelayEstimate]
    refusals: Mapping[str, str]

    @property
    def round_trip(self) -> Mapping[str, float]:
        """Measured round trips: ``mean``, ``p50``, ``p95``, ``p99``, ``largest``, in s."""
        found: Mapping[str, float] = self.plant["link"]["round_trip"]
        return found

    @property
    def age(self) -> float:
        """Mean age of the measurement behind the command in force, as measured, s."""
        return _number(self.plant["age"])

    @property
    def overshoot(self) -> float:
        """Overshoot of the step; 0.3 is 30 %. NaN where none was read."""
        fit = self.estimates.get("dominant") or self.estimates.get("exact")
        return math.nan if fit is None else float(fit.details["overshoot"])

    @property
    def is_unsteady(self) -> bool:
        """Whether the age of commands differs by more than waking up late explains."""
        ages = self.plant["age_when_applied"]
        lost = self.plant["link"]["lost"] + self.controller["link"]["lost"]
        spread = _number(ages["p95"]) - _number(ages["p50"])
        return lost > 0 or not spread < UNSTEADY * self.trial.sample_time

    def delay(self, method: str) -> float:
        """The delay by a method, s; NaN where it refused."""
        fit = self.estimates.get(method)
        return math.nan if fit is None else fit.delay

    def budget(self) -> dict[str, float]:
        """What the mean age is made of, s.

        ``round trip``, ``held`` (by the controller), ``hold`` (half the sample time: a command
        is in force until the next), and ``waiting`` for what was lost, overtaken or buffered.
        """
        parts = {
            "round trip": _number(self.round_trip["mean"]),
            "held": _number(self.plant["link"]["held"]["mean"]),
            "hold": 0.5 * self.trial.sample_time,
        }
        return {**parts, "waiting": self.age - sum(parts.values())}


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


@dataclass(frozen=True, eq=False)
class InternetLoop:
    """The runs of one network.

    Attributes
    ----------
    runs : tuple of InternetRun
        One a gain.
    """

    runs: tuple[InternetRun, ...]
    _errors: tuple[Mapping[str, NDArray[np.float64]], ...] = ()
    _age_error: float = math.nan

    def spread(self, method: str) -> Spread:
        """What the runs together say by a method; NaN where none answered."""
        delays = [run.delay(method) for run in self.runs]
        answered = [index for index, delay in enumerate(delays) if math.isfinite(delay)]
        found = Spread.of([delays[index] for index in answered])
        if method not in MAPS or not self._errors or not answered:
            return found
        errors = [self._errors[index][method] for index in answered]
        low, high = interval_of_mean(found.mean, errors, self._age_error)
        return replace(found, low=low, high=high, replayed=True)

    @property
    def age(self) -> float:
        """Mean measured age over the runs, s."""
        return float(np.mean([run.age for run in self.runs]))

    def expected(self, method: str) -> float:
        """What a method has to find by the age as measured, s."""
        hold = 0.5 * self.runs[0].trial.sample_time
        return self.age - (0.0 if METHODS[method] else hold)

    def explanation(self) -> list[str]:
        """The estimates against what was measured, a sentence or two each."""
        if not math.isfinite(self.age):
            return ["No command came in time in a run, so that no delay was measured."]
        budgets = [run.budget() for run in self.runs]
        mean = {name: 1e3 * float(np.mean([one[name] for one in budgets])) for name in budgets[0]}
        said = [
            f"Measured, the command in force is {1e3 * self.age:.1f} ms old on average: "
            f"{mean['round trip']:.1f} ms of round trip, {mean['held']:.1f} ms until the "
            f"controller answers, {mean['hold']:.1f} ms because a command holds for a sample time, "
            f"and {mean['waiting']:.1f} ms for packets that were lost, overtaken or buffered and "
            "processes that wake up late (below zero where the newest packets are faster than all)."
        ]
        unsteady = [run for run in self.runs if run.is_unsteady]
        if unsteady:
            said.append(
                "The delay is not constant: a step meets few of its values, and the interval of a "
                "single fit is for those. For the mean delay go by the intervals of the replayed "
                "steps, or make the delay constant with a jitter buffer."
            )
        for method, label in (("dominant", "The paper's overshoot method"), ("waveform", FIT)):
            found = self.spread(method)
            if found.count == 0:
                said.append(f"{label} has no answer in any run.")
                continue
            wanted = self.expected(method)
            knows = "which has the hold in it" if METHODS[method] else "the hold taken out"
            interval = ""
            if math.isfinite(found.low):
                how = "corrected by replaying" if found.replayed else "by the spread of the runs"
                interval = f" ({how} {1e3 * found.low:.1f} to {1e3 * found.high:.1f})"
            said.append(
                f"{label} finds {1e3 * found.mean:.1f} ms{interval}, where "
                f"{1e3 * wanted:.1f} ms was measured, {knows}."
            )
        return said

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "runs": [
                {
                    "gain": run.trial.gain,
                    "overshoot": run.overshoot,
                    "age": run.age,
                    "budget": run.budget(),
                    "plant": {k: v for k, v in run.plant.items() if k != "arrivals"},
                    "controller": run.controller,
                    "estimates": {name: fit.to_dict() for name, fit in run.estimates.items()},
                    "refusals": run.refusals,
                }
                for run in self.runs
            ],
            "age": self.age,
            "spread": {name: vars(self.spread(name)) for name in METHODS},
            "expected": {name: self.expected(name) for name in METHODS},
            "explanation": self.explanation(),
        }


FIT = "The fit of the waveform"


def run_internet_loop(
    trial: Trial,
    gains: Sequence[float] = GAINS,
    *,
    mode: Mode = "virtual",
    folder: Path | None = None,
    methods: Sequence[str] = tuple(METHODS),
    progress: Callable[[str], None] = lambda stage: None,
) -> InternetLoop:
    """Run the loop once for each gain, and estimate its delay from every run.

    Parameters
    ----------
    trial : Trial
        The loop and its network; the gain is replaced. Each run has a seed of its own, counted
        on from that of the trial.
    gains : sequence of float
        Gains of the controller, 1/s.
    mode : str
        ``"virtual"``: in virtual time, the same for the same seed; ``"real"``: over UDP, in this
        process; ``"processes"``: over UDP, plant, relay and controller in a process each.
    folder : Path, optional
        Where both ends write what they record.
    methods : sequence of str
        What the delay is estimated by: ``"dominant"`` (the paper's overshoot), ``"exact"``,
        ``"waveform"``, ``"output_error"``.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Returns
    -------
    InternetLoop

    Raises
    ------
    LinkError
        When a process does not start, or ends before its time.
    FileExistsError
        When the folder holds recordings of that name already.
    """
    if not len(gains):
        raise ValueError("gains is empty: give one or more")
    trials = [
        replace(trial, gain=positive("gain", gain), seed=trial.seed + index)
        for index, gain in enumerate(gains)
    ]
    if mode not in get_args(Mode):
        raise ValueError(f"mode={mode!r} is not one of {', '.join(get_args(Mode))}")
    unknown = set(methods) - set(METHODS)
    if unknown:
        raise ValueError(f"methods {sorted(unknown)} are none of {', '.join(METHODS)}")
    stems = [f"{index + 1:02d}-gain-{one.gain:g}-" for index, one in enumerate(trials)]
    for file in [] if folder is None else [folder / f"{a}{b}.csv" for a in stems for b in ENDS]:
        if file.exists():  # said before the first of them runs
            raise FileExistsError(EEXIST, "there already; choose another folder", str(file))
    runs = []
    for one, stem in zip(trials, stems, strict=True):
        progress(f"K = {one.gain:g}: running")
        reports, recordings = _run(one, mode, folder, stem)
        progress(f"K = {one.gain:g}: estimating")
        estimates, refusals = _estimate(one, recordings, methods)
        runs.append(
            InternetRun(
                one, reports["plant"], reports["controller"], recordings, estimates, refusals
            )
        )
    progress("replaying the steps")
    times = np.concatenate([answer_times(run.plant["arrivals"]) for run in runs])
    age = float(np.mean([run.age for run in runs]))
    if not (np.isfinite(times).any() and math.isfinite(age)):
        return InternetLoop(tuple(runs))
    errors = [replayed_errors(run.trial, times, age, REPLAYS, run.trial.seed) for run in runs]
    return InternetLoop(tuple(runs), tuple(errors), age_error(times, trial.sample_time))


def _run(
    trial: Trial, mode: Mode, folder: Path | None, stem: str
) -> tuple[dict[str, dict[str, Any]], dict[str, Recording]]:
    """What happened at each end, and what it recorded."""
    if mode != "processes":
        start = virtual_time.run if mode == "virtual" else asyncio.run
        report = start(run_trial(trial, folder, stem=stem))
        kept = {"plant": report.plant.recording, "controller": report.controller.recording}
        return report.to_dict(), {name: one for name, one in kept.items() if one is not None}
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
    """The delay by every method, and why some have no answer."""
    known = ControlLoop(
        Integrator(gain=trial.plant_gain),
        P(Kp=trial.gain),
        sample_time=trial.sample_time,
        limit=trial.limit,
    )
    estimates: dict[str, DelayEstimate] = {}
    refusals: dict[str, str] = {}
    free = ("delay", "gain") if trial.lag == 0.0 else ("delay", "gain", "lag")
    options: dict[str, dict[str, Any]] = {
        "dominant": {"method": "overshoot", "map": "dominant"},
        "exact": {"method": "overshoot", "map": "exact"},
        "waveform": {"method": "waveform", "free": free},
        "output_error": {"method": "output_error", "free": free},
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
            estimates[name] = estimate_delay(data, known, **options[name])
        except DeadtimeError as error:
            refusals[name] = str(error).rstrip(".")
    return estimates, refusals


def _as_sampled(recording: Recording, sample_time: float) -> Recording:
    """Reference and output of the plant on the grid of times at which it was to sample.

    A process wakes up a little late, by less than a sample time; the simulated loop samples
    on the grid, and would take a step of the reference just after a sample for one before the
    next. The mean lateness, which all rows have, stays where it was.
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
