"""Peaks and valleys of an answer that rings, and whether they die out.

Peaks are vertices of cubics fitted around them, so they lie between samples and average noise.

In a linear loop that is stable they fall from one to the next by a constant share. Where they do
not, the loop is in a limit cycle, kept up by the limit of its command, or at the end of its
stability: what linear theory says of such a response is wrong, by a factor of two for the delay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation.data._evidence import excited
from deadtime.estimation.data._step_reading import StepReading, scatter_of_bends
from deadtime.recordings import Recording

__all__ = [
    "Extreme",
    "check_dies_out",
    "read_extremes",
    "read_ringing",
    "weighted_slope",
]

Array = NDArray[np.float64]

#: Half of the part of a half period to which a cubic is fitted; a cosine leaves it by
#: (0.25 π)^4/24 = 1.6 % there, and the vertex far less.
AROUND = 0.25

#: An extreme stands out of the noise by this many standard deviations: the largest of a few hundred
#: samples of noise, some of which has gone round the loop, stays below.
CLEAR = 5.0

#: Heights below this share of the step are rounding.
SMALLEST = 1e-6

#: So many extremes, the first included, tell whether they die out.
ENOUGH = 4

#: They do where each is smaller than the one before by this share (at gains 4 % below the limit of
#: stability), and by so many standard errors, or the last smaller than this part of the first.
FALLS, CLEARANCE, FALLEN = 0.05, 2.0, 0.7

#: Half periods of an oscillation that goes on differ by less than this share.
UNEVEN = 0.25


class Extreme(NamedTuple):
    """A peak or valley: when, how far from the reference as a share of the step, and how sure."""

    time: float
    height: float
    time_error: float
    height_error: float


def read_extremes(answer: StepReading) -> list[Extreme]:
    """Peaks and valleys that stand out of the noise, from the first peak on."""
    return _extremes(answer.since, answer.travelled - 1.0, answer.noise)


def read_ringing(recording: Recording) -> list[Extreme]:
    """Peaks and valleys around the reference since it last moved, as shares of what excites."""
    moves = np.flatnonzero(np.diff(recording.reference))
    rows = slice(int(moves[-1]) + 1 if moves.size else 0, None)
    beyond = (recording.output - recording.reference)[rows] / excited(recording)
    if beyond.size < 3:
        return []
    return _extremes(recording.time[rows], beyond, scatter_of_bends(beyond))


def _extremes(since: Array, beyond: Array, noise: float) -> list[Extreme]:
    """Peaks and valleys of `beyond` that stand out of the noise, from the first peak on."""
    least = max(CLEAR * noise, SMALLEST)
    places: list[int] = []
    side = -1.0
    for row, value in enumerate(beyond):
        if side * value < -least:  # the other side of the reference, beyond doubt
            side = -side
            places.append(row)
        elif places and side * value > side * beyond[places[-1]]:
            places[-1] = row
    found: list[Extreme] = []
    for index, place in enumerate(places):
        gaps = np.diff(since[places[max(0, index - 1) : index + 2]])
        half = float(gaps.mean()) if gaps.size else float(since[place])
        vertex = _vertex(since, beyond, noise, place, AROUND * half)
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
        return None  # the window ends before the extreme has passed
    times = (since[near] - since[place]) / reach
    # Noise can take the vertex from a cubic; a parabola always has one.
    for degree in (3, 2) if times.size > 5 else (2,):
        powers = np.vander(times, degree + 1, increasing=True)
        coefficients, *_ = np.linalg.lstsq(powers, beyond[near], rcond=None)
        curve = np.polynomial.Polynomial(coefficients)
        vertex = _nearest_extreme(curve)
        if vertex is not None:
            break
    else:
        return None
    # Covariance of the coefficients for a noise of one: it matters of the noise-free case too.
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
    """Where the curve is farthest from zero, nearest to the middle of -1 to 1."""
    found = np.asarray(curve.deriv().roots(), dtype=complex)
    real = found[(np.abs(found.imag) < 1e-9) & (np.abs(found.real) <= 1.0)].real
    bend = curve.deriv(2)
    places = [float(root) for root in real if float(bend(root)) * float(curve(root)) < 0.0]
    return min(places, key=abs) if places else None


def check_dies_out(extremes: Sequence[Extreme], method: str) -> None:
    """Refuse an oscillation that goes on, for a method of linear theory."""
    if not _dies_out(extremes):
        raise NotIdentifiableError(
            f"the {len(extremes)} peaks and valleys do not die out (the last is "
            f"{extremes[-1].height / extremes[1].height:.3g} times the second): the loop is in a "
            f"limit cycle, or at its limit of stability, and the {method} method takes it for a "
            "linear loop that is stable; use method='output_error' or 'waveform' (or 'relay', "
            "where the command only switches), or a lower Kp"
        )


def _dies_out(extremes: Sequence[Extreme]) -> bool:
    """Whether the extremes after the first fall; so they do where they are too few to tell."""
    if len(extremes) < ENOUGH:
        return True
    # The first is that of a step, however long the limit made it.
    height = np.array([extreme.height for extreme in extremes[1:]])
    error = np.array([extreme.height_error for extreme in extremes[1:]])
    index = np.arange(height.size, dtype=np.float64)
    slope, slope_error = weighted_slope(index, np.log(height), error / height)
    half = np.diff([extreme.time for extreme in extremes])
    return bool(
        extremes[-1].height < FALLEN * extremes[0].height
        or -slope > max(FALLS, CLEARANCE * slope_error)
        or np.std(half) > UNEVEN * np.mean(half)
    )


def weighted_slope(index: Array, values: Array, errors: Array) -> tuple[float, float]:
    """Slope of a weighted line, and its standard error."""
    weights = 1.0 / errors**2
    centre = np.average(index, weights=weights)
    power = float(weights @ (index - centre) ** 2)
    return float(weights @ ((index - centre) * values)) / power, 1.0 / math.sqrt(power)
