"""One step of the reference in a recording, the response to it, and its peaks and valleys.

A peak is the vertex of a cubic fitted around it, so it may lie between samples and averages noise.

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
from deadtime.estimation.data._checks import excited
from deadtime.loops import ControlLoop, Integrator, P
from deadtime.recordings import Recording, Step

#: Smallest size of what is read from the response, in standard deviations of the noise.
CLEARANCE = 3.0

#: Longest time before the step over which the initial output is averaged, s.
BEFORE_STEP = 2.0

#: Fewest samples at rest whose standard deviation alone gives the noise.
ENOUGH = 20

#: Least share of the step at the end; below it the output does not follow the reference.
FOLLOWS = 0.5


#: A cubic is fitted to this share of a half period on either side of a peak. A cosine deviates from
#: it by (0.25 π)^4/24 = 1.6 % at the ends and far less at the vertex; a wider part averages more
#: noise and deviates more.
FITTED_SHARE = 0.25

#: Smallest height of an extreme, in standard deviations of the noise: the largest of a few hundred
#: samples of noise, part of it amplified by the loop, stays below.
CLEAR = 5.0

#: Heights below this share of the step count as rounding.
SMALLEST = 1e-6

#: Fewest extremes, the first included, from which it is decided whether they decay.
FEWEST_EXTREMES = 4

#: They decay if each is smaller than the one before by this share (as at gains 4 % below the
#: stability limit) and by so many standard errors, or if the last is below this share of the first.
LEAST_DECAY, DECAY_CLEARANCE, DECAYED = 0.05, 2.0, 0.7

#: Largest relative standard deviation of the half periods of a sustained oscillation.
UNEVEN = 0.25


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
            f"the {method} method is for an Integrator under P control, the loop has "
            f"{type(loop.plant).__name__} under {type(loop.controller).__name__}: use "
            "method='waveform'"
        )
    stiffness = loop.plant.gain * loop.controller.Kp
    if stiffness <= 0.0:
        raise ValueError(
            f"gain·Kp = {stiffness:g}: the loop must have negative feedback; check the signs"
        )
    return stiffness


def read_step(recording: Recording) -> StepReading:
    """The response to the one step in a recording; refuses windows with none or several."""
    steps = recording.steps()
    if not steps:
        raise NotIdentifiableError(
            "the reference is constant in the window, so there is no step; begin the window some "
            "samples before a step"
        )
    if len(steps) > 1:
        times = ", ".join(f"{step.time:g}" for step in steps[:6])
        raise NotIdentifiableError(
            f"{len(steps)} steps of the reference in the window (at {times} s): choose a window "
            "with one of them"
        )
    step = steps[0]
    after = recording.output[step.index :]
    before = recording.output[: step.index]
    before = before[recording.time[: step.index] >= step.time - BEFORE_STEP]
    if before.size == 0 or after.size < 4:
        raise NotIdentifiableError(
            f"the window leaves {before.size} samples before and {after.size} after the step at "
            f"{step.time:g} s: widen it"
        )
    start = float(before.mean())
    size = step.after - start
    if size == 0.0 or math.copysign(1.0, size) != math.copysign(1.0, step.amplitude):
        raise NotIdentifiableError(
            f"the output is {start:g} before the step from {step.before:g} to {step.after:g}: the "
            "loop was not at rest"
        )
    travelled = (after - start) / size
    since = recording.time[step.index :] - step.time
    tail = travelled[-max(4, travelled.size // 4) :]
    if float(np.mean(tail)) < FOLLOWS:
        raise NotIdentifiableError(
            f"the output ends at {100 * float(np.mean(tail)):.3g} % of the step at {step.time:g} "
            "s: it does not follow the reference; check columns and units, or widen the window"
        )
    noise = _noise(before, after[-max(4, after.size // 4) :]) / abs(size)
    return StepReading(step, start, before.size, size, noise, since, travelled)


def _noise(before: Array, tail: Array) -> float:
    """Standard deviation of the sensor noise, from the samples at rest."""
    resting = float(np.std(before, ddof=1)) if before.size >= 5 else 0.0
    if before.size >= ENOUGH:
        return resting
    # Few samples often give too small a value.
    return max(resting, noise_of_second_differences(tail))


def noise_of_second_differences(values: Array) -> float:
    """Standard deviation of the noise on a smooth signal of at least three values."""
    return float(np.median(np.abs(np.diff(values, 2)))) / 0.6745 / math.sqrt(6.0)


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
    """Peaks and valleys of `beyond` above the noise, from the first peak on."""
    least = max(CLEAR * noise, SMALLEST)
    places: list[int] = []
    side = -1.0
    for row, value in enumerate(beyond):
        if side * value < -least:  # clearly on the other side of the reference
            side = -side
            places.append(row)
        elif places and side * value > side * beyond[places[-1]]:
            places[-1] = row
    found: list[Extreme] = []
    for index, place in enumerate(places):
        gaps = np.diff(since[places[max(0, index - 1) : index + 2]])
        half = float(gaps.mean()) if gaps.size else float(since[place])
        vertex = _vertex(since, beyond, noise, place, FITTED_SHARE * half)
        if vertex is None:
            break
        found.append(vertex)
    return found


def _vertex(since: Array, beyond: Array, noise: float, place: int, reach: float) -> Extreme | None:
    """Vertex of a cubic through what lies within `reach` of a sample; None where there is none."""
    near = np.abs(since - since[place]) <= reach
    if int(near.sum()) < 5:
        near = np.abs(np.arange(beyond.size) - place) <= 2
    if not near[:-1].any() or near[-1] or int(near.sum()) < 5:
        return None  # the window ends before the extreme is over
    times = (since[near] - since[place]) / reach
    # With noise a cubic may have no vertex; a parabola always has one.
    for degree in (3, 2) if times.size > 5 else (2,):
        powers = np.vander(times, degree + 1, increasing=True)
        coefficients, *_ = np.linalg.lstsq(powers, beyond[near], rcond=None)
        curve = np.polynomial.Polynomial(coefficients)
        vertex = _nearest_extreme(curve)
        if vertex is not None:
            break
    else:
        return None
    # Covariance of the coefficients for noise of unit size.
    cov = np.linalg.inv(powers.T @ powers)
    at = vertex ** np.arange(degree + 1)
    rate = np.arange(degree + 1) * np.concatenate([[0.0], at[:-1]])
    noise = max(noise, SMALLEST)
    return Extreme(
        time=float(since[place]) + reach * vertex,
        height=float(abs(curve(vertex))),
        time_error=noise
        * math.sqrt(rate @ cov @ rate)
        / abs(float(curve.deriv(2)(vertex)))
        * reach,
        height_error=noise * math.sqrt(at @ cov @ at),
    )


def _nearest_extreme(curve: np.polynomial.Polynomial) -> float | None:
    """The extreme of the absolute value of the curve within -1 to 1 that is nearest to 0."""
    found = np.asarray(curve.deriv().roots(), dtype=complex)
    real = found[(np.abs(found.imag) < 1e-9) & (np.abs(found.real) <= 1.0)].real
    bend = curve.deriv(2)
    places = [float(root) for root in real if float(bend(root)) * float(curve(root)) < 0.0]
    return min(places, key=abs) if places else None


def check_decays(extremes: Sequence[Extreme], method: str) -> None:
    """Refuse a sustained oscillation, for a method of linear theory."""
    if not _decays(extremes):
        raise NotIdentifiableError(
            f"the {len(extremes)} peaks and valleys do not decay (the last is "
            f"{extremes[-1].height / extremes[1].height:.3g} times the second): the loop is in a "
            f"limit cycle, or at its stability limit, and the {method} method assumes a stable "
            "linear loop; use method='output_error' or 'waveform' (or 'relay', "
            "where the command only switches), or a lower Kp"
        )


def _decays(extremes: Sequence[Extreme]) -> bool:
    """Whether the extremes after the first decay; assumed where they are too few to decide."""
    if len(extremes) < FEWEST_EXTREMES:
        return True
    # The first one belongs to the step itself, which a limit may prolong.
    height = np.array([extreme.height for extreme in extremes[1:]])
    error = np.array([extreme.height_error for extreme in extremes[1:]])
    index = np.arange(height.size, dtype=np.float64)
    slope, slope_error = weighted_slope(index, np.log(height), error / height)
    half = np.diff([extreme.time for extreme in extremes])
    return bool(
        extremes[-1].height < DECAYED * extremes[0].height
        or -slope > max(LEAST_DECAY, DECAY_CLEARANCE * slope_error)
        or np.std(half) > UNEVEN * np.mean(half)
    )


def weighted_slope(index: Array, values: Array, errors: Array) -> tuple[float, float]:
    """Slope of a weighted line, and its standard error."""
    weights = 1.0 / errors**2
    centre = np.average(index, weights=weights)
    power = float(weights @ (index - centre) ** 2)
    return float(weights @ ((index - centre) * values)) / power, 1.0 / math.sqrt(power)
