"""The metrics of one step; its settling time with a proof that the output stays in the band."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from deadtime.loops import ControlLoop, sweep
from deadtime.tuning._tail import tail_bound

#: Half width of the band, as a part of the step.
BAND = 0.02

#: Deviation that may remain after the simulated time, as a part of the step: half of the overshoot
#: that counts as none.
_STILL = 5e-4

#: Most doublings of the simulated time until the remaining deviation is that small.
_DOUBLINGS = 6

#: Times at which the command is evaluated.
_POINTS = 4001

#: Part of the limit from which on a command counts as being at the limit.
_AT_LIMIT = 1.0 - 1e-9


class ProvedStep(NamedTuple):
    """Metrics of a step, proved for all times."""

    settling_time: float
    """s."""
    overshoot: float
    """%, to 0.05."""


def proved_step(loop: ControlLoop, amplitude: float) -> ProvedStep | None:
    """Simulate a step until its tail is proved to stay at rest; None where that fails."""
    if not loop.plant.is_rational:
        return None
    late = {"delay": loop.specification.known_delay}
    found = sweep(loop, late, amplitude=amplitude, settling=BAND)
    rest, end = loop.specification.steady_state(amplitude), float(found.time[-1])
    if rest is None or not np.isfinite(found["settling_time"]):
        return None
    for _ in range(_DOUBLINGS):
        if tail_bound(loop, amplitude, end) <= _STILL * abs(rest):
            break
        end *= 2.0
    else:
        return None
    found = sweep(loop, late, end, amplitude=amplitude, settling=BAND)
    settled = float(found["settling_time"])
    return ProvedStep(settled, float(found["overshoot"])) if np.isfinite(settled) else None


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
