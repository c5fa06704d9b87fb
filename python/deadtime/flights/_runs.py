"""Recorded flights: their recordings, telemetry, and the measures of their steps."""

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

Array = NDArray[np.float64]

#: Half width of the settling band of a flown step, as a share of the step, and its least width as a
#: multiple of the noise of the height. The usual 2 % are close to that noise.
BAND, NOISES = 0.05, 3.0


@dataclass(frozen=True)
class StepMeasures:
    """Measures of one flown step.

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
        Samples that were skipped.
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
    setpoint, climb, height : ndarray, shape (n,)
        Vertical speed that the vehicle follows, its vertical speed (m/s), and height (m).
    command_time, command : ndarray, shape (m,)
        Time of each command, s, and its value, m/s.
    """

    time: Array
    setpoint: Array
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
        The controller of the flight.
    recording : Recording
        Reference, height and command of each sample, read back from `path`.
    path : Path
        The file.
    telemetry : Path or None
        File with every message of the vehicle, if it passes them on.
    sample_time : float
        Intended time between two samples, s.
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
    def steps(self) -> list[StepMeasures]:
        """Measures of every step."""
        steps = self.recording.steps()
        ends = [step.index for step in steps[1:]] + [len(self.recording)]
        return [self._measures(step, end) for step, end in zip(steps, ends, strict=True)]

    def _measures(self, step: Step, end: int) -> StepMeasures:
        height = self.recording.output[step.index : end]
        beyond = (height - step.after) / step.amplitude
        band = max(BAND, NOISES * self.noise / abs(step.amplitude))
        outside = np.flatnonzero(np.abs(beyond) > band)
        settling = 0.0
        if outside.size:
            last = step.index + int(outside[-1]) + 1
            settling = np.nan if last >= end else float(self.recording.time[last] - step.time)
        return StepMeasures(step, 100.0 * max(0.0, float(beyond.max())), settling)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the height's noise, m: without the motion.

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
    """Every message of a flight, or None where the vehicle does not report setpoint and climb.

    Parameters
    ----------
    path : Path
        The saved messages.
    recording : Recording
        The recording of the same flight, which holds the commands.
    """
    names = ("time_s", "climb_setpoint_m_s", "climb_m_s", "height_m")
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
    """Columns of time, setpoint, climb and height without messages of the same instant."""
    time, setpoint, climb, height = columns
    later = np.append(np.diff(time) > 0.0, True)
    return Telemetry(
        time[later], setpoint[later], climb[later], height[later], command_time, command
    )
