"""A delay read from the picture of one step, as with ruler and pencil.

An integrator under P control does not move for Td after a step, then rises along a straight line,
because what it is commanded to do was decided before it moved, for another Td:

* ``tangent``: the line through that straight part, from Td to 2 Td (in a sampled loop to Td after
  the first sample that can see a movement), meets the start at Td. The part is found by drawing the
  line again until it stays where it is.
* ``two_point``: the line through the times at which two shares of the step are reached.
* ``first_movement``: the first sample that stands out of the noise for good; late by what it takes
  to stand out, and by up to a sample.

A limit does not bend the line, nor does the hold. A lag does: it counts as delay, in part. Shares
beyond K Td (or beyond limit Td over the step) are no longer on the line. Only the few samples on
the line are used, and there is no interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._extremes import check_dies_out, read_extremes
from deadtime.estimation.data._runs import Run
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.data._step_reading import CLEARANCE, StepReading, read_step, stiffness_of
from deadtime.estimation.methods._method import Method, check_choice
from deadtime.estimation.methods._read_off import check_delay_alone, read_off_estimate

__all__ = ["Construction", "Graphical"]

Construction = Literal["tangent", "two_point", "first_movement"]
Array = NDArray[np.float64]

#: Below this share of the step a movement is rounding.
LEAST = 1e-9

#: A tangent that is not drawn to rest after so many times jumps between two sets of samples.
DRAWN = 30


@dataclass(frozen=True)
class Graphical(Method):
    """Delay from the beginning of one step response, by a construction with straight lines.

    Parameters
    ----------
    construction : {"tangent", "two_point", "first_movement"}
        The line through the straight part of the rise, the line through two points of it, or the
        first sample that stands out of the noise.
    shares : (float, float)
        Shares of the step that the two points of ``"two_point"`` have reached, increasing.

    Raises
    ------
    ValueError
        For another construction, or shares that do not increase between 0 and 1.
    """

    construction: Construction = "tangent"
    shares: tuple[float, float] = (0.1, 0.35)

    name: ClassVar[str] = "graphical"

    def __post_init__(self) -> None:
        check_choice("construction", self.construction, get_args(Construction))
        low, high = self.shares
        if not 0.0 < low < high < 1.0:
            raise ValueError(f"shares={self.shares}: give two that increase, between 0 and 1")

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        ((recording, loop, window),) = runs
        check_delay_alone("graphical", free)
        simulated = SimulatedRecording(recording, loop, window)
        answer = read_step(simulated.recording)
        check_dies_out(read_extremes(answer), "graphical")
        moved = _first_movement(answer)
        delay, stderr = float(answer.since[moved]), math.nan
        if self.construction != "first_movement":
            stiffness_of(loop, "graphical")
        if self.construction == "two_point":
            delay = _two_point(answer, *self.shares)
        elif self.construction == "tangent":
            delay, stderr = _tangent(answer, moved, loop.sample_time)
        if not delay > 0.0:
            raise NotIdentifiableError(
                f"the line meets the start {-delay:.3g} s before the step: the samples on it are "
                "too few or too noisy, or there is no delay; use method='waveform'"
            )
        return read_off_estimate(
            "graphical",
            simulated,
            {"delay": delay},
            np.array([[stderr**2]]),
            answer.start,
            message=(
                f"{self.construction.replace('_', ' ')} of one step: a lag counts as delay, in part"
            ),
            uncalibrated=(
                "the graphical method looks at the first samples that move, and how it is misled "
                "by a lag or by its own thresholds is in no formula; use method='waveform' for an "
                "interval"
            ),
            details={
                "construction": self.construction,
                "first_movement": float(answer.since[moved]),
                "noise": answer.noise,
            },
        )


def _first_movement(answer: StepReading) -> int:
    """Row of the first sample from which on the output stays out of the noise around the start."""
    least = max(CLEARANCE * answer.noise, LEAST)
    still = np.flatnonzero(answer.travelled <= least)
    moved = int(still[-1]) + 1 if still.size else 0
    # A response that comes back to the start later, as an unstable one does, moved long before.
    half = int(np.argmax(answer.travelled >= 0.5))
    if moved > half:
        moved = int(np.flatnonzero(answer.travelled[:half] <= least)[-1]) + 1 if half else 0
    if moved == 0 or moved >= answer.travelled.size:
        raise NotIdentifiableError(
            f"the output moves within the first sample after the step at {answer.step.time:g} s, "
            "or not at all: there is no delay to be seen"
        )
    return moved


def _two_point(answer: StepReading, low: float, high: float) -> float:
    """Where the line through two shares of the step meets the start, s after the step."""
    if low < CLEARANCE * answer.noise:
        raise NotIdentifiableError(
            f"a share of {low:g} is within the noise of {answer.noise:.2g} of the step: give "
            "larger `shares`, or a larger step"
        )
    times = []
    for share in (low, high):
        row = int(np.argmax(answer.travelled >= share))
        before, after = answer.travelled[row - 1 : row + 1]
        part = (share - before) / (after - before)
        times.append(
            float(answer.since[row - 1] + part * (answer.since[row] - answer.since[row - 1]))
        )
    return times[0] - (times[1] - times[0]) * low / (high - low)


def _tangent(answer: StepReading, moved: int, held: float | None) -> tuple[float, float]:
    """Where the straight part meets the start, s after the step, and its standard error."""
    # Between the last sample that had not moved and the first that had.
    delay = 0.5 * float(answer.since[moved - 1] + answer.since[moved])
    line = (0.0, 0.0, math.nan)
    for _ in range(DRAWN):
        seen = delay if held is None else held * math.ceil(delay / held - 1e-9)
        until = delay + seen
        rows = (answer.since >= delay) & (answer.since <= until + 1e-9)
        if int(rows.sum()) < 2:
            raise NotIdentifiableError(
                f"{int(rows.sum())} samples on the straight part, from {delay:.3g} to "
                f"{until:.3g} s after the step: sample faster than twice a delay, or use "
                "method='waveform'"
            )
        line = _line(answer.since[rows], answer.travelled[rows], answer.noise)
        if line[0] <= 0.0:
            raise NotIdentifiableError(
                "the output falls where it should rise along a straight line: the noise drowns "
                "the beginning of the response; use method='waveform'"
            )
        drawn = line[1]
        if not 0.0 < drawn < 2.0 * delay or abs(drawn - delay) < 1e-12:
            break
        delay = drawn
    return line[1], line[2]


def _line(time: Array, share: Array, noise: float) -> tuple[float, float, float]:
    """Slope of a line, where it is zero, and the standard error of that place."""
    centre = float(time.mean())
    power = float(np.sum((time - centre) ** 2))
    slope = float((time - centre) @ share) / power
    if slope == 0.0:
        return 0.0, math.nan, math.nan
    place = centre - float(share.mean()) / slope
    variance = noise**2 / slope**2 * (1.0 / time.size + (centre - place) ** 2 / power)
    return slope, place, math.sqrt(variance)
