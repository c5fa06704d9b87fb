"""Flights that were flown: their recordings, read back, and the figures of their steps."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deadtime.loops import PV, P
from deadtime.recordings import Recording, Step

__all__ = [
    "FlownSteps",
    "LoopTiming",
    "StepFigures",
    "Telemetry",
    "named",
    "read_telemetry",
    "telemetry_of",
]

Array = NDArray[np.float64]

#: Half width of the band a flown step settles into, as a part of it: noise of the height is no
#: small part of the 2 % that are usual on paper. And as a multiple of that noise, at least.
BAND, NOISES = 0.05, 3.0


@dataclass(frozen=True)
class StepFigures:
    """What one flown step did.

    Attributes
    ----------
    step : Step
        The step of the reference.
    overshoot : float
        Percent of the step, as sampled.
    settling_time : float
        Time until the height stays within 5 % of the step, or within three times its noise where
        that is more, s; NaN if it does not before the end.
    """

    step: Step
    overshoot: float
    settling_time: float


@dataclass(frozen=True)
class LoopTiming:
    """Periods of the control loop as it ran, s.

    Attributes
    ----------
    period : float
        Median.
    jitter : float
        Standard deviation.
    longest : float
        The longest.
    missed : int
        Samples that were left out.
    """

    period: float
    jitter: float
    longest: float
    missed: int


@dataclass(frozen=True)
class Telemetry:
    """Every message of a flight, as it arrived, and the commands that were sent.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Arrival of each message since the first sample of the controller, s.
    demand, climb, height : ndarray, shape (n,)
        Vertical speed that the vehicle follows, its vertical speed (m/s), and height (m).
    command_time, command : ndarray, shape (m,)
        When each command was given, s, and what it was, m/s.
    """

    time: Array
    demand: Array
    climb: Array
    height: Array
    command_time: Array
    command: Array


@dataclass(frozen=True)
class FlownSteps:
    """One flight of altitude steps.

    Attributes
    ----------
    controller : P or PV
        What flew it.
    recording : Recording
        Reference, height and command of each sample, read back from `path`.
    path : Path
        The file.
    telemetry : Path or None
        File with every message of the vehicle, if it tells all.
    sample_time : float
        What it should have been, s.
    settle : float
        Time from the first sample to the first step, s.
    """

    controller: P | PV
    recording: Recording
    path: Path
    telemetry: Path | None
    sample_time: float
    settle: float

    @property
    def name(self) -> str:
        """The controller with its gains."""
        return named(self.controller)

    @cached_property
    def steps(self) -> list[StepFigures]:
        """Figures of every step."""
        steps = self.recording.steps()
        ends = [step.index for step in steps[1:]] + [len(self.recording)]
        return [self._figures(step, end) for step, end in zip(steps, ends, strict=True)]

    def _figures(self, step: Step, end: int) -> StepFigures:
        height = self.recording.output[step.index : end]
        beyond = (height - step.after) / step.amplitude
        band = max(BAND, NOISES * self.noise / abs(step.amplitude))
        outside = np.flatnonzero(np.abs(beyond) > band)
        settling = 0.0
        if outside.size:
            last = step.index + int(outside[-1]) + 1
            settling = np.nan if last >= end else float(self.recording.time[last] - step.time)
        return StepFigures(step, 100.0 * max(0.0, float(beyond.max())), settling)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the height's noise, m: of what no motion explains.

        From its second differences, to which motion adds little but around steps, by their median.
        """
        bends = np.abs(np.diff(self.recording.output, 2))
        return float(1.4826 * np.median(bends) / np.sqrt(6.0))

    @property
    def overshoot(self) -> float:
        """Mean overshoot of the steps, percent."""
        return float(np.mean([one.overshoot for one in self.steps]))

    @property
    def settling_time(self) -> float:
        """Mean settling time of the steps, s; NaN if one does not settle."""
        return float(np.mean([one.settling_time for one in self.steps]))

    def first_step(self) -> tuple[float, float]:
        """The part around the first step, s: from rest before it to the next step."""
        steps = self.recording.steps()
        begin = 0.5 * self.settle
        # Up to just before the next step.
        row = steps[1].index - 1 if len(steps) > 1 else len(self.recording) - 1
        return begin, float(self.recording.time[row])

    @property
    def timing(self) -> LoopTiming:
        """How even the control loop ran."""
        periods = np.diff(self.recording.time)
        missed = int(np.sum(np.round(periods / self.sample_time) - 1.0))
        return LoopTiming(
            float(np.median(periods)), float(periods.std()), float(periods.max()), missed
        )


def named(controller: P | PV) -> str:
    """A controller with its gains, in words."""
    gains = ", ".join(f"{name} = {value:.3g}" for name, value in controller.gains.items())
    return f"{type(controller).__name__}, {gains}"


def read_telemetry(path: Path, recording: Recording) -> Telemetry | None:
    """Every message of a flight, or None where the vehicle does not tell demand and climb.

    Parameters
    ----------
    path : Path
        As it was saved.
    recording : Recording
        The samples of the same flight, which tell the commands.
    """
    names = ("time_s", "climb_demand_m_s", "climb_m_s", "height_m")
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    cells = [[row[name] for name in names] for row in rows]
    whole = [row for row in cells if all(row)]
    if len(whole) < 8 or recording.command is None:
        return None
    columns = np.array(whole, dtype=np.float64).T
    return telemetry_of(columns, recording.time, recording.command)


def telemetry_of(
    columns: Sequence[Array] | Array, command_time: Array, command: Array
) -> Telemetry:
    """Columns of time, demand, climb and height without messages of the same instant."""
    time, demand, climb, height = columns
    later = np.append(np.diff(time) > 0.0, True)
    return Telemetry(time[later], demand[later], climb[later], height[later], command_time, command)
