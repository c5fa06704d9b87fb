"""Recorded flights: their recordings, telemetry, and the measures of their steps."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deadtime.flights._arrivals import Effects, as_they_took_effect
from deadtime.flights._clock import VehicleClock
from deadtime.links.axes import AXES, Axis
from deadtime.loops import PV, P
from deadtime.recordings import Recording, Step

Array = NDArray[np.float64]

#: Half width of the settling band of a flown step, as a share of the step, and its least width as a
#: multiple of the noise of the output. The usual 2 % are close to that noise.
BAND, NOISES = 0.05, 3.0

#: Share of left out samples above which a flight is called irregular: the loop was not the one that
#: gains are designed for.
MISSED = 0.03


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
        Time until the output stays within 5 % of the step, or within three times its noise where
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
    setpoint, rate, output : ndarray, shape (n,)
        The rate that the vehicle follows, its rate, and the output.
    command_time, command : ndarray, shape (m,)
        Time of each command, s, and its value.
    """

    time: Array
    setpoint: Array
    rate: Array
    output: Array
    command_time: Array
    command: Array


@dataclass(frozen=True)
class FlownSteps:
    """One flight of steps on an axis.

    Attributes
    ----------
    controller : P or PV
        The controller of the flight.
    recording : Recording
        Reference, output and command of each sample, read back from `path`.
    path : Path
        The file.
    telemetry : Path or None
        File with every message of the vehicle, if it passes them on.
    sample_time : float
        Intended time between two samples, s.
    settle : float
        Time from the first sample to the first step, s.
    axis : Axis
        What was stepped.
    """

    controller: P | PV
    recording: Recording
    path: Path
    telemetry: Path | None
    sample_time: float
    settle: float
    axis: Axis = AXES["z"]

    @cached_property
    def clock(self) -> VehicleClock | None:
        """The vehicle's clock, by its messages; None where they have no stamps or are too few."""
        if self.telemetry is None:
            return None
        return VehicleClock.of(*read_columns(self.telemetry, ("time_s", "vehicle_time_s")))

    @cached_property
    def measured(self) -> Recording:
        """The outputs when they were measured, and the commands as they took effect.

        Times of outputs are those of the vehicle's clock plus the mean age of the rows (see
        `_clock`). Where there is no such clock, it is `recording`. Commands are counted from when
        they were sent, and on a link that scatters from when they would have been sent on one of
        constant delay, where the vehicle reports which it follows (see `_arrivals`).
        """
        clock, rows, sent = self.clock, self.recording, self.effects
        if clock is None or sent is None:
            return rows
        time, stamp = read_columns(self.path, ("time_s", "vehicle_time_s"))
        seen = clock.time(stamp)
        seen += np.mean(time - seen)
        # A message that was the newest for several samples counts once.
        kept = np.append(True, np.diff(seen) > 0.0) & (seen >= sent.time[0])
        return Recording(
            seen[kept],
            rows.reference[kept],
            rows.output[kept],
            units=dict(rows.units),
            source=rows.source,
            sent=(sent.time, sent.values),
        )

    @cached_property
    def effects(self) -> Effects | None:
        """The commands as they took effect; None where the outputs have no times of their own."""
        rows, clock = self.recording, self.clock
        if clock is None or rows.command is None or self.telemetry is None:
            return None
        (time, _) = read_columns(self.path, ("time_s", "vehicle_time_s"))
        if time.size != len(rows):
            return None
        arrival, stamp = read_columns(self.telemetry, ("time_s", "vehicle_time_s"))
        # Without echoes the way there is taken to scatter as the way back.
        sent = Effects(time, rows.command, float(np.std(arrival - clock.time(stamp))))
        names = ("setpoint_time_s", self.axis.columns[2])
        stamp, setpoint = read_columns(self.telemetry, names)
        return as_they_took_effect(sent, clock.time(stamp), setpoint)

    @property
    def age(self) -> float | None:
        """Mean age of the outputs, s: how much older than the newest possible message they were."""
        if self.clock is None:
            return None
        time, stamp = read_columns(self.path, ("time_s", "vehicle_time_s"))
        return float(np.mean(time - self.clock.time(stamp)))

    @property
    def irregular(self) -> str:
        """Why the times of the flight are not to be relied on, or nothing."""
        clock, timing = self.clock, self.timing
        if clock is not None and not clock.even:
            return (
                f"the vehicle's clock deviated by {1e3 * clock.misfit:.0f} ms from the clock of "
                "this computer, so one of the two stopped or ran slowly for a time"
            )
        samples = len(self.recording) + timing.missed
        if timing.missed > MISSED * samples:
            return (
                f"the control loop ran late and skipped {timing.missed} of {samples} samples, "
                "because this computer was too busy"
            )
        return ""

    @property
    def name(self) -> str:
        """The controller with its gains."""
        return named(self.controller)

    @cached_property
    def steps(self) -> list[StepMeasures]:
        """Measures of every step."""
        return measures_of(self.recording)

    @property
    def noise(self) -> float:
        """Standard deviation of the output's noise: without the motion."""
        return noise_of(self.recording)

    @property
    def overshoot(self) -> float:
        """Mean overshoot of the steps, percent."""
        return float(np.mean([step.overshoot for step in self.steps]))

    @property
    def settling_time(self) -> float:
        """Mean settling time of the steps, s; NaN if one does not settle."""
        return float(np.mean([step.settling_time for step in self.steps]))

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


def measures_of(recording: Recording) -> list[StepMeasures]:
    """Measures of every step of a recording."""
    steps, noise = recording.steps(), noise_of(recording)
    ends = [step.index for step in steps[1:]] + [len(recording)]
    found = []
    for step, end in zip(steps, ends, strict=True):
        beyond = (recording.output[step.index : end] - step.after) / step.amplitude
        band = max(BAND, NOISES * noise / abs(step.amplitude))
        outside = np.flatnonzero(np.abs(beyond) > band)
        settling = 0.0
        if outside.size:
            last = step.index + int(outside[-1]) + 1
            settling = np.nan if last >= end else float(recording.time[last] - step.time)
        found.append(StepMeasures(step, 100.0 * max(0.0, float(beyond.max())), settling))
    return found


def noise_of(recording: Recording) -> float:
    """Standard deviation of the noise of an output: without the motion.

    From its second differences, to which motion adds little but around steps, by their median.
    """
    bends = np.abs(np.diff(recording.output, 2))
    return float(1.4826 * np.median(bends) / np.sqrt(6.0))


def settled(time: float) -> str:
    """A settling time in words."""
    return f"{time:.2f}" if np.isfinite(time) else "not"


def named(controller: P | PV) -> str:
    """A controller with its gains, in words."""
    gains = ", ".join(f"{name} = {value:.3g}" for name, value in controller.gains.items())
    return f"{type(controller).__name__}, {gains}"


def read_columns(path: Path, names: Sequence[str]) -> Array:
    """Columns of a saved file, shape (len(names), n), of the rows that have all of them."""
    with path.open(newline="", encoding="utf-8") as stream:
        cells = [[row.get(name) for name in names] for row in csv.DictReader(stream)]
    whole = [row for row in cells if all(row)]
    return np.array(whole, dtype=np.float64).reshape(-1, len(names)).T


def read_telemetry(flight: FlownSteps) -> Telemetry | None:
    """Every message of a flight, or None where the vehicle does not report setpoint and rate."""
    recording = flight.recording
    if flight.telemetry is None or recording.command is None:
        return None
    output, rate, setpoint = flight.axis.columns
    columns = read_columns(flight.telemetry, ("time_s", setpoint, rate, output))
    if columns.shape[1] < 8:
        return None
    return telemetry_of(columns, recording.time, recording.command)


def telemetry_of(
    columns: Sequence[Array] | Array, command_time: Array, command: Array
) -> Telemetry:
    """Columns of time, setpoint, rate and output without messages of the same instant."""
    time, setpoint, rate, output = columns
    later = np.append(np.diff(time) > 0.0, True)
    return Telemetry(
        time[later], setpoint[later], rate[later], output[later], command_time, command
    )
