"""Checks that a window excites the loop, and that the output responds."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.recordings import Recording

__all__ = ["ROUNDING", "check_excitation", "check_gain", "check_moves", "start_and_span"]

Array = NDArray[np.float64]

#: A constant reference excites the loop if it differs from the initial output by at least so many
#: standard deviations of the noise.
CLEARANCE = 5.0

#: A fitted gain below so many standard errors is indistinguishable from zero.
LEAST_GAIN = 3.0

#: Residuals below this share of the output's range count as rounding.
ROUNDING = 1e-9


def check_moves(output: Array, command: Array | None = None) -> None:
    """Refuse a constant command, and a constant output."""
    if command is not None and float(np.ptp(command)) == 0.0:
        raise NotIdentifiableError(
            f"the command is {command[0]:g} throughout the window: it does not excite the vehicle; "
            "choose a window in which the command changes"
        )
    if float(np.ptp(output)) == 0.0:
        raise NotIdentifiableError(
            f"the output is {output[0]:g} throughout the window: the vehicle did not move; choose "
            "another window, and check the column"
        )


def check_excitation(data: Recording, numbers: int, *, in_motion: bool = False) -> None:
    """Refuse a window without excitation, or in which the output does not move.

    A window with rows before it (`in_motion`) has to contain a step; a whole recording may begin
    with one.
    """
    steps = data.steps()
    noise = float(np.median(np.abs(np.diff(data.output)))) / 0.6745 / math.sqrt(2.0)
    away = abs(float(data.reference[0] - data.output[0]))
    at_rest = away <= max(CLEARANCE * noise, ROUNDING * float(np.ptp(data.output)))
    if not steps and (in_motion or at_rest):
        raise NotIdentifiableError(
            f"the reference is {data.reference[0]:g} throughout the window: it does not excite the "
            "loop; choose a window with a step"
        )
    left = len(data) - (steps[0].index if steps else 0)
    if left < 2 * (numbers + 1):
        raise NotIdentifiableError(
            f"{left} samples after the step are too few for {numbers} parameters and an initial "
            "output: widen the window"
        )
    check_moves(data.output)


def start_and_span(data: Recording) -> tuple[float, float]:
    """Output before the first step, and the time from that step to the end, s.

    If the reference is constant, the step is taken to be at the first sample.
    """
    steps = data.steps()
    rest = data.output[: max(1, steps[0].index)] if steps else data.output[:1]
    begin = steps[0].time if steps else data.time[0]
    return float(rest.mean()), float(data.time[-1] - begin)


def check_gain(values: Mapping[str, float], errors: Mapping[str, float]) -> None:
    """Refuse a fitted gain that may be zero: any delay would then fit as well."""
    if "gain" in values and abs(values["gain"]) < LEAST_GAIN * errors["gain"]:
        raise NotIdentifiableError(
            f"the gain comes out at {values['gain']:.2g} ± {errors['gain']:.2g}, which may be "
            "zero: the output does not respond to the input, or the noise hides the response; "
            "check columns and units"
        )
