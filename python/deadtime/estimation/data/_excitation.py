"""Whether anything was asked of the loop in a window, and whether it answered."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.recordings import Recording

__all__ = ["ROUNDING", "check_excitation", "check_gain", "check_moves", "start_and_span"]

Array = NDArray[np.float64]

#: The reference is away from the output at the start by so many standard deviations of the noise,
#: or does not excite the loop.
CLEARANCE = 5.0

#: A gain this many times its standard error is one.
ANSWERS = 3.0

#: Misfits below this share of the output's range are rounding.
ROUNDING = 1e-9


def check_moves(output: Array, command: Array | None = None) -> None:
    """Refuse a command that never changes, and an output that never moves."""
    if command is not None and float(np.ptp(command)) == 0.0:
        raise NotIdentifiableError(
            f"the command is {command[0]:g} throughout the window: nothing excites the vehicle; "
            "choose a window in which the command changes"
        )
    if float(np.ptp(output)) == 0.0:
        raise NotIdentifiableError(
            f"the output is {output[0]:g} throughout the window: the vehicle did not move"
        )


def check_excitation(data: Recording, numbers: int, *, in_motion: bool = False) -> None:
    """Refuse a window in which nothing is asked of the loop or nothing moves.

    A window that begins `in_motion`, after rows before it, has to hold a step; a recording may
    begin with one.
    """
    steps = data.steps()
    noise = float(np.median(np.abs(np.diff(data.output)))) / 0.6745 / math.sqrt(2.0)
    away = abs(float(data.reference[0] - data.output[0]))
    there = away <= max(CLEARANCE * noise, ROUNDING * float(np.ptp(data.output)))
    if not steps and (in_motion or there):
        raise NotIdentifiableError(
            f"the reference is {data.reference[0]:g} throughout the window: nothing excites the "
            "loop; choose a window with a step"
        )
    left = len(data) - (steps[0].index if steps else 0)
    if left < 2 * (numbers + 1):
        raise NotIdentifiableError(
            f"{left} samples after the step are too few for {numbers} numbers and an initial "
            "output: widen the window"
        )
    check_moves(data.output)


def start_and_span(data: Recording) -> tuple[float, float]:
    """Output before the first step, and the time from that step to the end, s.

    Where the reference does not move, the step is at the first sample.
    """
    steps = data.steps()
    rest = data.output[: max(1, steps[0].index)] if steps else data.output[:1]
    begin = steps[0].time if steps else data.time[0]
    return float(rest.mean()), float(data.time[-1] - begin)


def check_gain(values: Mapping[str, float], errors: Mapping[str, float]) -> None:
    """Refuse a fitted gain that might as well be none: then no delay explains anything."""
    if "gain" in values and abs(values["gain"]) < ANSWERS * errors["gain"]:
        raise NotIdentifiableError(
            f"the gain comes out at {values['gain']:.2g} ± {errors['gain']:.2g}, which may be none "
            "at all: the output is no answer to what was asked, or the noise drowns it; check "
            "columns and units"
        )
