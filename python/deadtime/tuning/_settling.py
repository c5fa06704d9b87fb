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

#: Part of the limit from which on a command counts as being at the limit.
_AT_LIMIT = 1.0 - 1e-9


class ProvedStep(NamedTuple):
    """Metrics of a step, proved for all times."""

    settling_time: float
    """s."""
    overshoot: float
    """%, to 0.05."""


def proved_steps(
    loop: ControlLoop, sets: Sequence[Mapping[str, float]], amplitude: float
) -> list[ProvedStep | None]:
    """Simulate steps until their tails are proved to stay at rest; None where that fails.

    `sets` are numbers of the loop that differ from step to step.
    """
    if not loop.plant.is_rational:
        return [None] * len(sets)
    late = loop.specification.known_delay
    names = {"delay": late}.keys() | sets[0].keys()
    values = {name: np.array([{"delay": late, **one}[name] for one in sets]) for name in names}
    found = sweep(loop, values, amplitude=amplitude, settling=BAND)
    settles = np.isfinite(found["settling_time"])
    ends = [
        _still_from(loop.replace(**one), amplitude, float(found.time[-1])) if known else None
        for one, known in zip(sets, settles, strict=True)
    ]
    longest = max((end for end in ends if end is not None), default=None)
    if longest is None:
        return [None] * len(sets)
    found = sweep(loop, values, longest, amplitude=amplitude, settling=BAND)
    figures = zip(ends, found["settling_time"], found["overshoot"], strict=True)
    return [
        ProvedStep(float(settled), float(over)) if end and np.isfinite(settled) else None
        for end, settled, over in figures
    ]


def _still_from(loop: ControlLoop, amplitude: float, end: float) -> float | None:
    """A time from `end` on after which a step is proved to stay at rest."""
    rest = loop.specification.steady_state(amplitude)
    for _ in range(0 if rest is None else _DOUBLINGS):
        if tail_bound(loop, amplitude, end) <= _STILL * abs(rest):
            return end
        end *= 2.0
    return None


def step_info(loop: ControlLoop, amplitude: float) -> dict[str, float]:
    """`Response.info` of the step, largest command, and how long it is at the limit, s.

    The settling time is NaN where it is not proved that the output stays in the band.
    """
    response = loop.step_response(amplitude=amplitude)
    (proved,) = proved_steps(loop, [{}], amplitude)
    known = {"settling_time": float("nan")} if proved is None else proved._asdict()
    info = response.info() | known
    time = np.linspace(0.0, response.time[-1], _POINTS)
    command = np.abs(loop.simulate(time, amplitude).inputs)
    limited = 0.0
    if loop.limit is not None:
        limited = float(np.mean(command >= _AT_LIMIT * loop.limit) * time[-1])
    return info | {"peak_command": float(command.max()), "time_at_limit": limited}
