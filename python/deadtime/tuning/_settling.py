"""The metrics of one step; its settling time with a proof that the output stays in the band."""

from __future__ import annotations

import numpy as np

from deadtime.loops import ControlLoop
from deadtime.tuning._native import proved_step

#: Times at which the command is evaluated.
_POINTS = 4001

#: Distance from a limit, as a part of it, within which a command counts as being at it.
_AT_LIMIT = 1e-9


def step_info(loop: ControlLoop, amplitude: float) -> dict[str, float]:
    """`Response.info` of the step, largest command, and how long it is at the limit, s.

    The settling time is NaN where it is not proved that the output stays in the band.
    """
    response = loop.step_response(amplitude=amplitude)
    proved = proved_step(loop.specification.kernel, amplitude)
    info = response.info() | {"settling_time": float("nan")}
    if proved is not None:
        info |= {"settling_time": proved[0], "overshoot": proved[1]}
    time = np.linspace(0.0, response.time[-1], _POINTS)
    command = loop.simulate(time, amplitude).inputs
    low, high = loop.specification.bounds
    at_limit = (command >= high - _AT_LIMIT * abs(high)) | (command <= low + _AT_LIMIT * abs(low))
    limited = float(np.mean(at_limit) * time[-1]) if np.isfinite(high - low) else 0.0
    return info | {"peak_command": float(np.abs(command).max()), "time_at_limit": limited}
