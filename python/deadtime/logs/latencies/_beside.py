"""A fit beside the plain numbers of the field, from the same rows.

Each method is applied to the log and to what the fitted plant answers to the same setpoint at the
same rows. Where both differ by more than their intervals allow, the plant is not that of the log.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from deadtime._base.digits import between as ends_of, shown
from deadtime.logs._log import LogLoop
from deadtime.logs.latencies._between import refined
from deadtime.logs.latencies._commands import Sampling
from deadtime.logs.latencies._modelled import modelled
from deadtime.logs.latencies._plain import (
    Difference,
    PlainTime,
    PlainTimes,
    differences,
    plain_times,
)
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.logs.latencies._windows import LENGTHS, LONGEST

#: What a reason says after the plain number that contradicts the fit.
CONTRADICTED = "the log gives"


def beside_plain_numbers(found: LoopLatency, loop: LogLoop, sampling: Sampling) -> LoopLatency:
    """The time of a loop from its setpoint with the plain numbers, doubted where they differ.

    There is no time where the response precedes its setpoint by the interval of a plain number.
    """
    fit = found.estimate
    if fit is None and not found.windows:
        return found
    both = loop.setpoint, loop.response
    longest = LONGEST * LENGTHS[loop.kind]
    between = sampling.between
    own = plain_times(*both, loop.segments, longest=longest, between=between)
    if fit is None or fit.plant is None:
        return replace(found, plain=own)
    if ahead := [plain for plain in own.all if plain.interval[1] < 0.0]:
        return _without_time(found, own, _why_ahead(ahead[0]))
    asked, late = loop.setpoint, 0.0
    if between == "straight":
        # As the fit takes it; each command holds for a while from its row on.
        known = np.isfinite(asked.values)
        time, values = refined(asked.time[known], asked.values[known])
        asked, late = replace(asked, time=time, values=values), 0.5 * sampling.hold
    answer = modelled(fit.plant, fit.delay + late, asked, loop.response, loop.segments, between)
    of_fit = plain_times(
        loop.setpoint, answer, loop.segments,
        longest=longest, between=between, moves=own.aligned.moves,
    )  # fmt: skip
    differ = differences(own, of_fit)
    found = replace(found, plain=own, differences=differ, answered=of_fit.aligned)
    half = 0.5 * (found.interval[1] - found.interval[0])
    for difference in differ:
        if why := _why_different(difference, half):
            found = found.doubted(why)
    return found


def _without_time(found: LoopLatency, own: PlainTimes, why: str) -> LoopLatency:
    """The loop without its time, for this reason, with the plain numbers."""
    return LoopLatency(
        found.loop, found.axis, found.kind, found.command, "none", why,
        windows=found.windows, times=found.times, sampling=found.sampling, plain=own,
    )  # fmt: skip


def _why_ahead(time: PlainTime) -> str:
    """How far the response precedes its setpoint by a plain number."""
    low, high = time.interval
    error = 0.25 * (high - low)
    return (
        f"by {time.name} the response comes {shown(-time.value, error, 's')} before "
        f"its setpoint (95 %: {ends_of(-high, -low, error, 's')})"
    )


def _why_different(difference: Difference, half: float) -> str:
    """How far a plain number is from that of the fit; empty where it may be the same.

    `half` is half the interval of the time of the fit, s.
    """
    low, high = difference.interval
    distance = abs(difference.measured - difference.modelled)
    if not (difference.disagrees and distance > math.hypot(0.5 * (high - low), half)):
        return ""
    error = 0.25 * (high - low)
    return (
        f"by {difference.name} {CONTRADICTED} {shown(difference.measured, error, 's')}, but the "
        f"fit gives {shown(difference.modelled, error, 's')}"
    )
