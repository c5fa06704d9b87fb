"""The command of every row of a recording: logged, or as the controller makes it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.loops import ControlLoop, P
from deadtime.recordings import Recording

__all__ = ["commands_over_samples", "known_commands", "moves_between_rows"]

#: A logged command is the controller's own where it differs from that by so little of its size:
#: noise that is in the log alone parts them.
ALIKE = 0.2


def known_commands(recording: Recording, loop: ControlLoop) -> tuple[NDArray[np.float64], str]:
    """Commands within the limit, and where they come from.

    What a P controller commands at a sample depends on that sample alone, so it can be computed
    from the log; other controllers remember what came before the log.
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
    """Whether a logged command is that of a continuous P controller, and so is held nowhere.

    Anything else that was logged as a command, such as a setpoint, is taken as held.
    """
    if loop.is_sampled or recording.command is None or not isinstance(loop.controller, P):
        return False
    made, _ = known_commands(replace(recording, command=None), loop)
    logged, _ = known_commands(recording, loop)
    return float(np.std(made - logged)) < ALIKE * float(np.std(logged))


def commands_over_samples(
    recording: Recording, loop: ControlLoop
) -> tuple[NDArray[np.float64], str]:
    """Mean command from each sample to the next, and where the commands come from.

    A sampled loop holds its command. That of a continuous one moves from sample to sample, on a
    line to second order; where the reference jumps at a sample, up to just before the jump.
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
