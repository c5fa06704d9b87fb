"""What a design makes best: the smaller the better, the worst scenario counts.

abscissa       Re of the rightmost pole.
damping        the smallest damping ratio -Re s/abs(s) of the dominant poles, those that decay at
               most three times as fast as the slowest (a delay always leaves fast poles with little
               damping, which do not show). It is 1 over whole ranges of gains, so the abscissa
               decides where it is equal.
settling_time  of the step of the reference, with hold and limit, simulated exactly; the longest
               for the gains themselves and for gains half a percent beside them. The settling
               time jumps where a peak leaves the band, and the shortest one lies next to such a
               jump: gains that are rounded to three digits would fall over it.
overshoot      of the same steps; up to a tenth of a percent counts as none, and the settling time
               decides where it is equal.
"""

from __future__ import annotations

from typing import get_args

from deadtime.tuning._problem import ObjectiveName

#: Cost of a loop that does not settle: above every other cost.
NEVER = 1e6

#: Those that are found by poles, and by simulated steps.
_BY_POLES: tuple[ObjectiveName, ...] = ("abscissa", "damping")
SIMULATED: tuple[ObjectiveName, ...] = ("settling_time", "overshoot")


def objective_named(name: str) -> ObjectiveName:
    """The objective of that name, which is no response."""
    known: tuple[ObjectiveName, ...] = (*_BY_POLES, *SIMULATED)
    for objective in get_args(ObjectiveName):
        if objective == name and objective in known:
            return objective  # type: ignore[no-any-return]
    raise ValueError(f"objective={name!r}: give one of {', '.join(map(repr, known))}")


def lost(objective: ObjectiveName, value: float, reference: float) -> float:
    """How much worse a figure is than a reference, as a part of that."""
    worse = reference - value if objective == "damping" else value - reference
    return worse / max(abs(reference), 1e-300)
