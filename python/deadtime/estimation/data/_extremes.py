"""Peaks and valleys of an oscillating response, and whether they decay.

A peak is the vertex of a cubic fitted around it, so it may lie between samples and averages noise.

In a stable linear loop each peak is smaller than the one before by a constant factor. Where that is
not so, the loop is in a limit cycle that the limit of its command sustains, or at its stability
limit: linear theory then gives a wrong delay, by up to a factor of two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation.data._evidence import excited
from deadtime.estimation.data._step_reading import StepReading, noise_of_second_differences
from deadtime.recordings import Recording

__all__ = [
    "Extreme",
    "check_decays",
    "read_extremes",
    "read_ringing",
    "weighted_slope",
]

Array = NDArray[np.float64]

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
ENOUGH = 4

#: They decay if each is smaller than the one before by this share (as at gains 4 % below the
#: stability limit) and by so many standard errors, or if the last is below this share of the first.
LEAST_DECAY, CLEARANCE, DECAYED = 0.05, 2.0, 0.7

#: Largest relative standard deviation of the half periods of a sustained oscillation.
UNEVEN = 0.25


class Extreme(NamedTuple):
    """A peak or valley: time, height beyond the reference as a share of the step, their errors."""

    time: float
    height: float
    time_error: float
    height_error: float


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
    if len(extremes) < ENOUGH:
        return True
    # The first one belongs to the step itself, which a limit may prolong.
    height = np.array([extreme.height for extreme in extremes[1:]])
    error = np.array([extreme.height_error for extreme in extremes[1:]])
    index = np.arange(height.size, dtype=np.float64)
    slope, slope_error = weighted_slope(index, np.log(height), error / height)
    half = np.diff([extreme.time for extreme in extremes])
    return bool(
        extremes[-1].height < DECAYED * extremes[0].height
        or -slope > max(LEAST_DECAY, CLEARANCE * slope_error)
        or np.std(half) > UNEVEN * np.mean(half)
    )


def weighted_slope(index: Array, values: Array, errors: Array) -> tuple[float, float]:
    """Slope of a weighted line, and its standard error."""
    weights = 1.0 / errors**2
    centre = np.average(index, weights=weights)
    power = float(weights @ (index - centre) ** 2)
    return float(weights @ ((index - centre) * values)) / power, 1.0 / math.sqrt(power)
