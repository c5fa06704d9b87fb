"""The command of every row of a recording: as logged, or computed from the controller."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.loops import ControlLoop, P
from deadtime.recordings import Recording

__all__ = ["commands_over_samples", "known_commands", "moves_between_rows"]

#: A logged command is taken to be the P controller's where the two differ by less than this share
#: of the command's standard deviation. Larger values accept more noise in the log, and more foreign
#: commands.
ALIKE = 0.2


def known_commands(recording: Recording, loop: ControlLoop) -> tuple[NDArray[np.float64], str]:
    """Commands within the limit, and their source in words.

    The command of a P controller depends on its sample alone, so it can be computed from the log;
    the command of other controllers depends on samples before the log.
    """
    limit = math.inf if loop.limit is None else loop.limit
    if recording.command is not None:
        return np.clip(recording.command, -limit, limit), "logged"
    if not isinstance(loop.controller, P):
        raise NotIdentifiableError(
            "the recording holds no command, and only that of a P controller can be computed from "
            "reference and output: log the command, or use method='waveform'"
        )
    command = loop.controller.Kp * (recording.reference - recording.output)
    return np.clip(command, -limit, limit), "computed from reference and output"


def moves_between_rows(recording: Recording, loop: ControlLoop) -> bool:
    """Whether a logged command is that of a continuous P controller, which is not held.

    Any other logged command, such as a setpoint, is taken as held between rows.
    """
    if loop.is_sampled or recording.command is None or not isinstance(loop.controller, P):
        return False
    computed, _ = known_commands(replace(recording, command=None), loop)
    logged, _ = known_commands(recording, loop)
    return float(np.std(computed - logged)) < ALIKE * float(np.std(logged))


def commands_over_samples(
    recording: Recording, loop: ControlLoop
) -> tuple[NDArray[np.float64], str]:
    """Mean command from each sample to the next, and the source of the commands in words.

    A sampled loop holds its command. In a continuous loop the mean is that of a straight line
    between the samples (second order); where the reference steps at a sample, the line ends just
    before the step.
    """
    command, source = known_commands(recording, loop)
    if loop.is_sampled:
        return command, source
    before = command[1:].copy()
    jumps = np.flatnonzero(np.diff(recording.reference))
    if jumps.size and isinstance(loop.controller, P):
        limit = math.inf if loop.limit is None else loop.limit
        Kp, output = loop.controller.Kp, recording.output[jumps + 1]
        old, new = (
            np.clip(Kp * (recording.reference[rows] - output), -limit, limit)
            for rows in (jumps, jumps + 1)
        )
        before[jumps] -= new - old
    return np.append(0.5 * (command[:-1] + before), command[-1]), source
