"""One step of the reference in a recording, the response to it, and its peaks and valleys.

In a stable linear loop each peak is smaller than the one before by a constant factor. Where that is
not so, the loop is in a limit cycle that the limit of its command sustains, or at its stability
limit: linear theory then gives a wrong delay, by up to a factor of two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import extremes_decay, step_extremes
from deadtime.estimation.data._checks import excited
from deadtime.loops import ControlLoop, Integrator, P
from deadtime.recordings import Recording, Step, noise_of_second_differences

#: Smallest size of what is read from the response, in standard deviations of the noise.
CLEARANCE = 3.0

#: Longest time before the step over which the initial output is averaged, s.
BEFORE_STEP = 2.0

#: Fewest samples at rest whose standard deviation alone gives the noise.
ENOUGH = 20

#: Least share of the step at the end; below it the output does not follow the reference.
FOLLOWS = 0.5


@dataclass(frozen=True, eq=False)
class StepReading:
    """The response to one step.

    Attributes
    ----------
    step : Step
        The step.
    start : float
        Mean output before the step.
    start_samples : int
        Number of samples in that mean.
    size : float
        From `start` to the new reference.
    noise : float
        Standard deviation of the sensor noise, as a share of the step.
    since : ndarray, shape (n,)
        Time since the step, s.
    travelled : ndarray, shape (n,)
        Output as a share of the step: 0 at the start, 1 at the new reference.
    """

    step: Step
    start: float
    start_samples: int
    size: float
    noise: float
    since: Array
    travelled: Array

    @property
    def tail(self) -> Array:
        """The last quarter of `travelled`."""
        return self.travelled[-max(4, self.travelled.size // 4) :]


def stiffness_of(loop: ControlLoop, method: str) -> float:
    """K = gain·Kp of the loop, which has to be an integrator under proportional control."""
    if not isinstance(loop.plant, Integrator) or not isinstance(loop.controller, P):
        raise ValueError(
            f"the {method} method is for an Integrator under P control, but the loop has "
            f"{type(loop.plant).__name__} under {type(loop.controller).__name__}: use "
            "method='waveform'"
        )
    stiffness = loop.plant.gain * loop.controller.Kp
    if stiffness <= 0.0:
        raise ValueError(
            f"gain·Kp = {stiffness:g}, so the feedback is not negative: check the signs of "
            "gain and Kp"
        )
    return stiffness


def read_step(recording: Recording) -> StepReading:
    """The response to the one step in a recording; refuses windows with none or several."""
    steps = recording.steps()
    if not steps:
        raise NotIdentifiableError(
            "the reference is constant in the window, so there is "
            "no step: begin the window some samples before a step"
        )
    if len(steps) > 1:
        times = ", ".join(f"{step.time:g}" for step in steps[:6])
        raise NotIdentifiableError(
            f"the reference has {len(steps)} steps in the window "
            f"(at {times} s): choose a window with one step"
        )
    step = steps[0]
    after = recording.output[step.index :]
    before = recording.output[: step.index]
    before = before[recording.time[: step.index] >= step.time - BEFORE_STEP]
    if before.size == 0 or after.size < 4:
        raise NotIdentifiableError(
            f"the window has only {before.size} samples before the step at "
            f"{step.time:g} s and {after.size} after the step: choose a longer window"
        )
    start = float(before.mean())
    size = step.after - start
    if size == 0.0 or math.copysign(1.0, size) != math.copysign(1.0, step.amplitude):
        raise NotIdentifiableError(
            f"before the step from {step.before:g} to {step.after:g} the output is "
            f"{start:g}, so the loop was not at rest: choose a window that begins at rest"
        )
    since = recording.time[step.index :] - step.time
    noise = _noise(before, after[-max(4, after.size // 4) :]) / abs(size)
    travelled = (after - start) / size
    reading = StepReading(step, start, before.size, size, noise, since, travelled)
    ended = float(np.mean(reading.tail))
    if ended < FOLLOWS:
        raise NotIdentifiableError(
            f"the output ends at {100 * ended:.3g} % of the "
            f"step at {step.time:g} s, so it does not follow the "
            "reference: check columns and units, or choose a longer window"
        )
    return reading


def _noise(before: Array, tail: Array) -> float:
    """Standard deviation of the sensor noise, from the samples at rest."""
    resting = float(np.std(before, ddof=1)) if before.size >= 5 else 0.0
    if before.size >= ENOUGH:
        return resting
    # Few samples often give too small a value.
    return max(resting, noise_of_second_differences(tail))


class Extreme(NamedTuple):
    """A peak or valley: time, height beyond the reference as a share of the step, their errors."""

    time: float
    height: float
    time_error: float
    height_error: float


def read_decaying_step(recording: Recording, method: str) -> tuple[StepReading, list[Extreme]]:
    """The one step and its extremes, for a method of linear theory; refuses what does not decay."""
    reading = read_step(recording)
    extremes = read_extremes(reading)
    check_decays(extremes, method)
    return reading, extremes


def read_extremes(reading: StepReading) -> list[Extreme]:
    """Peaks and valleys above the noise, from the first peak on."""
    return _extremes(reading.since, reading.travelled - 1.0, reading.noise)


def read_ringing(recording: Recording) -> list[Extreme]:
    """Peaks and valleys around the reference since its last step, as shares of the excitation."""
    moves = np.flatnonzero(np.diff(recording.reference))
    rows = slice(int(moves[-1]) + 1 if moves.size else 0, None)
    beyond = (recording.output - recording.reference)[rows] / excited(recording)
    if beyond.size < 3:
        return []
    return _extremes(recording.time[rows], beyond, noise_of_second_differences(beyond))


def _extremes(since: Array, beyond: Array, noise: float) -> list[Extreme]:
    return [Extreme(*fields) for fields in step_extremes(since, beyond, noise)]


def check_decays(extremes: Sequence[Extreme], method: str) -> None:
    """Refuse a sustained oscillation, for a method of linear theory."""
    if not extremes_decay(list(extremes)):
        raise NotIdentifiableError(
            f"the {len(extremes)} peaks and valleys do not decay: the last has "
            f"{extremes[-1].height / extremes[1].height:.3g} times the height of the "
            f"second. The {method} method assumes a stable linear loop, but this loop "
            "is in a limit cycle or at its stability limit. Use method='output_error' "
            "or 'waveform' (or 'relay', if the command only switches), or a lower Kp"
        )
