"""The metrics of one step; its settling time with a proof that the output stays in the band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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

#: Distance from a limit, as a part of it, within which a command counts as being at it.
_AT_LIMIT = 1e-9


class ProvedStep(NamedTuple):
    """Metrics of a step, proved for all times."""

    settling_time: float
    """s."""
    overshoot: float
    """%, to 0.05."""


def proved_steps(
    loop: ControlLoop, sets: Sequence[Mapping[str, float]], amplitude: float
) -> list[ProvedStep | None]:
    """Simulate steps, each with other numbers, until proved to rest; None where that fails."""
    if not loop.plant.is_rational or not _is_plain(loop):
        return [None] * len(sets)
    late = {"delay": loop.specification.known_delay}
    values = {
        name: np.array([(late | dict(one))[name] for one in sets]) for name in late | dict(sets[0])
    }
    found = sweep(loop, values, amplitude=amplitude, settling=BAND)
    end, settles = float(found.time[-1]), np.isfinite(found["settling_time"])
    ends = [
        _still_from(loop.replace(**one), amplitude, end) if known else 0.0
        for one, known in zip(sets, settles, strict=True)
    ]
    if any(ends):
        found = sweep(loop, values, max(ends), amplitude=amplitude, settling=BAND)
    figures = zip(ends, found["settling_time"], found["overshoot"], strict=True)
    return [
        ProvedStep(*map(float, step)) if end and np.isfinite(step[0]) else None
        for end, *step in figures
    ]


def _still_from(loop: ControlLoop, amplitude: float, end: float) -> float:
    """A time from `end` on after which a step is proved to stay at rest; 0 if there is none."""
    rest = loop.specification.steady_state(amplitude)
    if rest is not None:
        for later in end * 2.0 ** np.arange(_DOUBLINGS):
            if tail_bound(loop, amplitude, float(later)) <= _STILL * abs(rest):
                return float(later)
    return 0.0


def step_info(loop: ControlLoop, amplitude: float) -> dict[str, float]:
    """`Response.info` of the step, largest command, and how long it is at the limit, s.

    The settling time is NaN where it is not proved that the output stays in the band.
    """
    response = loop.step_response(amplitude=amplitude)
    (proved,) = proved_steps(loop, [{}], amplitude)
    known = {"settling_time": float("nan")} if proved is None else proved._asdict()
    info = response.info() | known
    time = np.linspace(0.0, response.time[-1], _POINTS)
    command = loop.simulate(time, amplitude).inputs
    low, high = loop.specification.bounds
    at_limit = (command >= high - _AT_LIMIT * abs(high)) | (command <= low + _AT_LIMIT * abs(low))
    limited = float(np.mean(at_limit) * time[-1]) if np.isfinite(high - low) else 0.0
    return info | {"peak_command": float(np.abs(command).max()), "time_at_limit": limited}


def _is_plain(loop: ControlLoop) -> bool:
    """Whether a loop has no other bound than equal ones of its command, as the proof takes it."""
    guard = getattr(loop.controller, "anti_windup", None)
    return loop.rate_limit is None and guard is None and isinstance(loop.limit, float | None)
