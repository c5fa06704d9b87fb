"""Graphical construction of the delay from the beginning of one step response.

An integrator under P control does not move for Td after a step. For another Td it rises along a
straight line, because the commands that arrive were computed before it moved:

* ``tangent``: the line through that straight part, from Td to 2 Td (in a sampled loop to Td after
  the first sample that can see a movement), meets the initial output at Td. The straight part is
  found by iteration.
* ``two_point``: the line through the times at which two shares of the step are reached.
* ``first_movement``: the first sample from which on the output stays above the noise; later than
the
  delay by the time this takes, and by up to a sample.

A limit and a hold do not bend the line. A lag does: part of it counts as delay. Shares beyond K Td
(or beyond limit Td over the step) are no longer on the line. Only the few samples on the line are
used, and there is no interval.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import deadtime.estimation.data._step_reading as steps
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import first_movement, line_through, rise_tangent
from deadtime.estimation.methods._method import OfOne, Read, Run, check_choice

Construction = Literal["tangent", "two_point", "first_movement"]

#: Movements below this share of the step, and delays below this share of the response, count as
#: rounding.
LEAST = 1e-9


@dataclass(frozen=True)
class Graphical(OfOne):
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
    limits: ClassVar[str] = (
        "The method reads the few samples on the first straight part of the step, and counts "
        "part of a lag as delay."
    )

    def __post_init__(self) -> None:
        check_choice("construction", self.construction, get_args(Construction))
        low, high = self.shares
        if not 0.0 < low < high < 1.0:
            raise ValueError(f"shares={self.shares}: give two increasing numbers between 0 and 1")

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        reading, _ = steps.read_decaying_step(simulated.recording, "graphical")
        moved = _first_movement(reading)
        delay, stderr = float(reading.since[moved]), math.nan
        if self.construction != "first_movement":
            steps.stiffness_of(loop, "graphical")
        if self.construction == "two_point":
            delay = _two_point(reading, *self.shares)
        elif self.construction == "tangent":
            delay, stderr = _tangent(reading, moved, loop.sample_time)
        if not delay > LEAST * float(reading.since[-1]):
            raise NotIdentifiableError(
                f"the line meets the initial output {-delay:.3g} s before the step. Either its "
                "samples are too few or too noisy, or there is no delay. Use method='waveform'"
            )
        return Read(
            {"delay": delay},
            stderr,
            reading.start,
            message=(
                f"{self.construction.replace('_', ' ')} of one step: part of a lag counts as delay"
            ),
            uncalibrated=(
                "the graphical method uses the first samples that move. Its error from a lag "
                "or from its thresholds is not known. Use method='waveform' for an interval"
            ),
            details={
                "construction": self.construction,
                "first_movement": float(reading.since[moved]),
                "noise": reading.noise,
            },
        )


def _first_movement(reading: steps.StepReading) -> int:
    """Row of the first sample from which on the output stays above the noise."""
    moved = first_movement(reading.travelled, max(steps.CLEARANCE * reading.noise, LEAST))
    if moved is None:
        raise NotIdentifiableError(
            f"the output moves within the first sample after the step at {reading.step.time:g} "
            "s, or not at all, so no delay can be read. Use method='waveform'"
        )
    return moved


def _two_point(reading: steps.StepReading, low: float, high: float) -> float:
    """Time after the step, s, at which the line through two shares meets the initial output."""
    if low < steps.CLEARANCE * reading.noise:
        raise NotIdentifiableError(
            f"the smaller of `shares`, {low:g}, is too close to the noise, which is "
            f"{reading.noise:.2g} of the step. Give larger `shares`, or a larger step"
        )
    return line_through(reading.since, reading.travelled, (low, high))


def _tangent(reading: steps.StepReading, moved: int, held: float | None) -> tuple[float, float]:
    """Time after the step, s, at which the straight part meets the initial output; its error."""
    # Between the last sample that had not moved and the first that had.
    delay = 0.5 * float(reading.since[moved - 1] + reading.since[moved])
    found, few = rise_tangent(reading.since, reading.travelled, delay, held, reading.noise)
    if few is not None:
        count, begin, until = few
        raise NotIdentifiableError(
            f"the straight part, from {begin:.3g} to {until:.3g} s after the step, has only "
            f"{count} samples: sample faster than twice a delay, or use method='waveform'"
        )
    if found is None:
        raise NotIdentifiableError(
            "the output falls during the part of the response that should be a rising line, "
            "so noise hides this part. Use method='waveform'"
        )
    return found
