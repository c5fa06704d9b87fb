"""Metrics of the step of a designed loop and of its command."""

from __future__ import annotations

import numpy as np

from deadtime.loops import ControlLoop
from deadtime.tuning._settling import proved_step

__all__ = ["step_info"]

#: Times at which the command is evaluated.
_POINTS = 4001

#: Part of the limit from which on a command counts as being at the limit.
_AT_LIMIT = 1.0 - 1e-9


def step_info(loop: ControlLoop, amplitude: float) -> dict[str, float]:
    """`Response.info` of the step, largest command, and how long it is at the limit, s.

    The settling time is NaN where it is not proved that the output stays in the band.
    """
    response = loop.step_response(amplitude=amplitude)
    proved = proved_step(loop, amplitude)
    known = {"settling_time": float("nan")} if proved is None else proved._asdict()
    info = response.info() | known
    time = np.linspace(0.0, response.time[-1], _POINTS)
    command = np.abs(loop.simulate(time, amplitude).inputs)
    limited = 0.0
    if loop.limit is not None:
        limited = float(np.mean(command >= _AT_LIMIT * loop.limit) * time[-1])
    return info | {"peak_command": float(command.max()), "time_at_limit": limited}
