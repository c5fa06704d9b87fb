"""Proportional gains that stabilise a loop, of either sign, and the ranges a search begins with.

Poles cross the stability boundary only at gains k where 1 + k L = 0 on it, so that between two
neighbours of these gains all loops are stable or none is, and one in the middle decides
(Neimark 1949). Of a continuous loop `crossings` proves the list complete between two ends; of a
sampled one it is the list of `ControlLoop.margin`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deadtime.loops import ControlLoop, P
from deadtime.roots import crossings
from deadtime.systems import TransferFunction
from deadtime.tuning._native import Candidates

Range = tuple[float, float]

#: Highest frequency at which the gains of a continuous loop are sought: turns of the delay, and
#: multiples of the fastest corner of the plant. The gains needed there bound the search.
_TURNS = 3.0
_CORNERS = 100.0
#: Frequencies at which these gains are evaluated.
_POINTS = 120

#: Part of the largest gain of a plant with direct feedthrough up to which gains are sought: beyond
#: it chains of roots lie on the right.
_BELOW_ALGEBRAIC = 1.0 - 1e-6

#: Ratio to the median below which, or above the inverse of which, a critical gain of a sampled loop
#: counts as rounding.
_ROUNDING = 1e-9

#: Where no proportional gain is stable: frequencies, in units of one over delay and lag, at which
#: the plant gives the scale of the gains.
_SCALES = (1.0, 0.3, 3.0, 0.1, 10.0)


@dataclass(frozen=True)
class StableGains:
    """Open intervals of the proportional gain that are stable, among those up to `most`."""

    intervals: tuple[Range, ...]
    most: float
    #: The sign of the plant's steady gain where it has one, else 1.
    sign: float

    @property
    def widest(self) -> Range | None:
        """The interval with the most room."""
        return max(self.intervals, key=lambda ends: ends[1] - ends[0], default=None)

    @property
    def critical(self) -> float:
        """The end of the widest interval at which a growing gain loses stability; 0 for none."""
        low, high = self.widest or (0.0, 0.0)
        if low < 0.0 < high:
            return high if self.sign > 0.0 else low
        return high if abs(high) > abs(low) else low


def stable_gains(loop: ControlLoop) -> StableGains:
    """The proportional gains that stabilise a loop, whatever its controller is."""
    plain = loop.replace(controller=P(1.0))
    num, den = loop.plant.polynomials()
    sign = float(np.sign(num[-1] * den[-1])) or 1.0
    most = np.inf if loop.is_sampled else _most(plain, num, den)
    if not loop.is_sampled:
        return StableGains(
            _joined(crossings(plain, {"Kp": (-most, most)}).stable_ranges), most, sign
        )
    edges = _sampled_edges(plain)
    far = 2.0 * max(abs(edges[0]), abs(edges[-1])) or 1.0
    tests = [-far, *(0.5 * (low + high) for low, high in pairwise(edges)), far]
    ends = [-np.inf, *edges, np.inf]
    judged = Candidates([plain.specification.kernel], [0])
    late = judged.costs(np.array(tests)[:, None], "abscissa", None)[:, 0]
    stable = [gap for gap, pole in zip(pairwise(ends), late, strict=True) if pole < 0.0]
    return StableGains(_joined(stable), most, sign)


def critical_gain(loop: ControlLoop) -> float:
    """Proportional gain at which a loop loses stability, infinite where none does.

    Negative where negative gains stabilise it, as with a plant of negative gain.
    """
    found = stable_gains(loop)
    if found.widest is None:
        raise ValueError(none_stable(loop, found))
    critical = found.critical
    # The end of the search is no critical gain of the loop.
    return critical if abs(critical) < found.most else float(np.copysign(np.inf, critical))


def none_stable(loop: ControlLoop, found: StableGains) -> str:
    """Error text: no gain is stable, and up to which gain was searched."""
    far = "" if np.isinf(found.most) else f" up to abs(Kp) = {found.most:.4g}"
    return (
        f"no proportional gain{far} stabilises this loop with its delay of {loop.delay:g} s. "
        "Use a controller with a derivative, such as PV, or give ranges="
    )


def candidate_ranges(loop: ControlLoop, free: Sequence[str]) -> tuple[dict[str, Range], ...]:
    """Ranges of the gains to look at, one after the other until one of them holds a stable loop."""
    found = stable_gains(loop)
    late = (loop.delay or 0.0) + loop.parameters.get("lag", 0.0) + 0.5 * (loop.sample_time or 0.0)
    if found.widest is None:
        if tuple(free) == ("Kp",) and isinstance(loop.controller, P):
            raise ValueError(none_stable(loop, found))
        scales = [1.0 / abs(_at(loop, scale / max(late, 1e-9))) for scale in _SCALES]
        return tuple(
            _ranges(free, sign * found.sign * scale, late) for scale in scales for sign in (1, -1)
        )
    critical = found.critical
    if not abs(critical) < found.most:
        raise ValueError(
            "no proportional gain makes this loop unstable, so the search has no upper end: "
            "give ranges="
        )
    low, high = found.widest
    other = low if critical == high else high
    wide = _ranges(free, critical, late)
    # A narrow interval far from zero falls between the points of a wide map.
    width = critical - other
    narrow = _ranges(free, 0.25 * width, late) | {"Kp": found.widest}
    return wide, {name: narrow[name] for name in free}


def _ranges(free: Sequence[str], critical: float, late: float) -> dict[str, Range]:
    """Ranges around the critical proportional gain; the other gains follow by time constants."""
    parts = {
        "Kp": (0.02 * critical, 1.25 * critical),
        "Ki": (0.0, 0.5 * critical / max(late, 1e-9)),
    }
    ranges = {name: parts.get(name, (-0.1 * critical * late, critical * late)) for name in free}
    return {name: (min(ends), max(ends)) for name, ends in ranges.items()}


def _at(loop: ControlLoop, omega: float) -> complex:
    """The plant's response, the delay and the hold left out."""
    return complex(loop.plant.transfer_function().frequency_response(np.array([omega]))[0])


def _most(plain: ControlLoop, num: NDArray[np.float64], den: NDArray[np.float64]) -> float:
    """Largest proportional gain that is searched for a continuous loop."""
    if len(num) == len(den):
        # Beyond that chains of roots lie on the right, however short the delay.
        return float(_BELOW_ALGEBRAIC * abs(den[0] / num[0]))
    late = plain.specification.known_delay
    corners = np.abs(np.concatenate([np.roots(num), np.roots(den)]))
    corners = corners[corners > 0.0]
    low = min([*corners, 1.0 / late if late else np.inf], default=1.0)
    fast = [_CORNERS * float(corners.max(initial=0.0))]
    fast += [2.0 * np.pi * _TURNS / late] if late else []
    omega = np.geomspace(1e-2 * low, max(*fast, low), _POINTS)
    plant: TransferFunction = plain.plant.transfer_function()
    needed = 1.0 / np.abs(plant.frequency_response(omega))
    # The gain needed at a notch is arbitrarily large and bounds nothing.
    return float(2.0 * needed[np.isfinite(needed) & (needed < 1e6 * np.median(needed))].max())


def _sampled_edges(plain: ControlLoop) -> list[float]:
    """Gains of either sign at which a pole of a sampled loop may be on the unit circle."""
    up, down = (loop._margin(delay_margin=False) for loop in (plain, plain.replace(Kp=-1.0)))
    every = np.append(up.gain_margins, -down.gain_margins)
    # A zero or pole of the plant on the unit circle gives a gain that is rounding only.
    size = np.median(np.abs(every)) if every.size else 1.0
    known = (np.abs(every) < size / _ROUNDING) & (np.abs(every) > size * _ROUNDING)
    return sorted({0.0, *every[known].tolist()})


def _joined(intervals: Sequence[Range]) -> tuple[Range, ...]:
    """Intervals that touch, as one: a pole that only touches the boundary parts nothing."""
    joined: list[Range] = []
    for low, high in intervals:
        if joined and joined[-1][1] == low:
            joined[-1] = (joined[-1][0], high)
        else:
            joined.append((low, high))
    return tuple(joined)
