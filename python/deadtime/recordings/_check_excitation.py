"""Whether a recording holds anything to learn a delay from: motion, and a cause of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import ControlLoop, Integrator
from deadtime.recordings._check_command import Command
from deadtime.recordings._findings import Columns, Finding

#: Fewest rows with motion in which a reference can be said to copy the output.
FEWEST_MOVES = 8

#: A constant reference excites the loop if it differs from the initial output by at least so many
#: standard deviations of the noise.
AWAY = 5.0

#: A reference within this share of the output's range of the output is reached but for rounding.
REACHED = 1e-9

#: Ratio of the range of the output to that of the excitation above which the loop is hardly damped,
#: or no such loop, and one below which the output does not follow.
LARGEST, LEAST = 2.5, 0.02


def copied_setpoint(reference: Array, output: Array) -> Finding | None:
    """A reference that equals the output, as loggers write it while a mode is inactive."""
    moving = np.flatnonzero(np.diff(output)) + 1
    copied = int(np.sum(reference[moving] == output[moving]))
    if moving.size < FEWEST_MOVES or copied <= 0.5 * moving.size:
        return None
    return Finding(
        "setpoint_copied",
        "refused",
        f"in {copied} of the {moving.size} rows in which the output moves, the reference equals "
        "the output. Either the setpoint is inactive in these rows, or one column was read "
        "twice. Choose a window in which the controller follows a setpoint",
        "the delay would be estimated as zero",
    )


def no_motion(output: Array, command: Array | None = None) -> Finding | None:
    """A constant command, or a constant output."""
    if command is not None and float(np.ptp(command)) == 0.0:
        return Finding(
            "command_constant",
            "refused",
            f"the command is {command[0]:g} throughout the window, so it does not excite the "
            "vehicle. Choose a window in which the command changes",
            "any delay would fit",
        )
    if float(np.ptp(output)) == 0.0:
        return Finding(
            "output_constant",
            "refused",
            f"the output is {output[0]:g} throughout the window, so the vehicle did not move. "
            "Choose another window, and check the column",
            "any delay would fit",
        )
    return None


def no_excitation(reference: Array, output: Array, *, in_motion: bool) -> Finding | None:
    """A constant reference; one away from the output excites, unless the loop is `in_motion`."""
    if float(np.ptp(reference)) > 0.0:
        return None
    noise = float(np.median(np.abs(np.diff(output)))) / 0.6745 / math.sqrt(2.0)
    away = abs(float(reference[0] - output[0]))
    at_rest = away <= max(AWAY * noise, REACHED * float(np.ptp(output)))
    if not (in_motion or at_rest):
        return None
    return Finding(
        "no_step",
        "refused",
        f"the reference is {reference[0]:g} throughout the window, so it does not excite the "
        "loop. Choose a window with a step",
        "the estimated delay would depend only on noise and wind",
    )


def excitation_findings(
    columns: Columns, command: Command, loop: ControlLoop, *, in_motion: bool
) -> Iterator[Finding]:
    """What the excitation does to an estimate."""
    copied = copied_setpoint(columns.reference, columns.output)
    if copied is not None:
        yield copied
        return
    still = no_motion(columns.output, columns.commands(loop))
    if still is not None:
        if still.code == "command_constant" and command.saturated == 1.0:
            still = replace(
                still,
                code="saturated",
                message="the command is at its limit throughout the window, so it does not "
                "excite the vehicle. Choose a window with a smaller step, or only the "
                "end of this window",
            )
        yield still
        return
    resting = no_excitation(columns.reference, columns.output, in_motion=in_motion)
    if resting is not None:
        if columns.command is None:
            yield resting
        elif command.law != "differs":  # Otherwise something else than the output moves it.
            yield replace(resting, severity="warning")
        return
    yield from _range_finding(columns, loop)


def _range_finding(columns: Columns, loop: ControlLoop) -> Iterator[Finding]:
    """An output much larger or smaller than the excitation of a loop that reaches its reference."""
    if not isinstance(loop.plant, Integrator):
        return
    away = abs(float(columns.reference[0] - columns.output[0]))
    excited = max(float(np.ptp(columns.reference)), away)
    ratio = float(np.ptp(columns.output)) / excited
    if LEAST < ratio < LARGEST:
        return
    yield Finding(
        "output_range",
        "warning",
        f"the range of the output is {ratio:.3g} times the range of the reference, but an "
        "output that follows its reference has about the same range. Check the units, that "
        "reference and output belong to one loop, and that the loop was closed",
        "a fit of the loop may give any delay",
        math.inf,
    )
