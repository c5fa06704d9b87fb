"""Moves of a setpoint: changes from one rest to the next.

A rest is a stretch of rows within a share of the size of the move beside it: the setpoint rests,
moves slowly, or turns. So moves are looked for by size, the largest first, and none overlaps a
larger one. Jumps and ramps, a staircase and the swings of a stick are all found that way, at 10
and at 1000 rows a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs._series import Series
from deadtime.logs._windows import runs

#: Least size of a move, in standard deviations of the noise of the response, and as a share of the
#: most by which the setpoint changes within the longest time: smaller ones are hidden by others.
NOISES, OF_RANGE = 6.0, 0.1

#: How much a setpoint that rests may change, as a share of the size of the move beside it.
RESTS = 0.2

#: Longest change of a move, and how long the response is followed after half of it, in rough times.
CHANGE, FOLLOWED = 4.0, 8.0


class Move(NamedTuple):
    """One move of the setpoint: times in s, levels in its unit.

    `start` is the end of its rest before the move, `half` the time of half of the change, and
    `stop` the end of its rest afterwards; it goes from `level` to `level + size`. Each rest is
    `rest` or longer, and `rough` a rough time from setpoint to response.
    """

    start: float
    half: float
    stop: float
    level: float
    size: float
    rest: float
    rough: float


def least_size(
    setpoint: Series, response: Series, segments: Sequence[tuple[float, float]], longest: float
) -> float:
    """Size from which a change of the setpoint counts as a move, in its unit."""
    wide = max(2, round(longest / setpoint.period))
    asked = [rows_of(setpoint, segment)[1] for segment in segments]
    responses = [rows_of(response, segment)[1] for segment in segments]
    bends = np.concatenate([np.diff(values, 2) for values in responses] or [np.empty(0)])
    noise = 1.4826 * float(np.median(np.abs(bends))) / math.sqrt(6.0) if bends.size else 0.0
    span = max(
        (float(np.max(_spans(values, wide))) for values in asked if values.size), default=0.0
    )
    return max(NOISES * noise, OF_RANGE * span)


def moves_in(
    setpoint: Series, segment: tuple[float, float], scales: tuple[float, float], least: float,
    held: bool,
) -> list[Move]:  # fmt: skip
    """The moves in one segment, the largest first found, in their order in time.

    `scales` are the shortest rest and the rough time from setpoint to response, s.
    """
    time, values = rows_of(setpoint, segment)
    rest = scales[0]
    wide = max(2, math.ceil(rest / setpoint.period) + 1)
    if values.size < 2 * wide or not least > 0.0:
        return []
    spans = _spans(values, wide)
    found: list[Move] = []
    scale = least * 2.0 ** max(0, math.floor(math.log2(max(float(np.ptp(values)) / least, 1.0))))
    largest = math.inf
    while scale >= least:
        rests = [(a, b + wide - 2) for a, b in runs(spans <= RESTS * scale)]
        for (_, p), (q, _) in pairwise(rests):
            move = _move(time, values, (p, q, wide), scales, held) if q > p else None
            if move is None or not scale <= abs(move.size) < largest:
                continue
            if all(move.half <= other.start or move.start >= other.half for other in found):
                found.append(move)
        largest, scale = scale, 0.5 * scale
    return sorted(found)


def _move(
    time: Array,
    values: Array,
    rows: tuple[int, int, int],
    scales: tuple[float, float],
    held: bool,
) -> Move | None:
    """The move from the rest that ends in row p to that which begins in row q; None for none."""
    (p, q, wide), (rest, rough) = rows, scales
    before = float(np.median(values[max(0, p - wide + 1) : p + 1]))
    size = float(np.median(values[q : q + wide])) - before
    if size == 0.0 or time[q] - time[p] > CHANGE * rough:
        return None
    level = (values - before) / size
    if np.min(level[p : q + 1]) < -RESTS or np.max(level[p : q + 1]) > 1.0 + RESTS:
        return None
    half = float(time[p]) + below_half(time[p : q + 1], level[p : q + 1], held)
    until = int(np.searchsorted(time, half + FOLLOWED * rough, side="right"))
    away = np.flatnonzero(np.abs(level[q:until] - 1.0) > RESTS)
    last = q + int(away[0]) - 1 if away.size else until - 1
    return Move(float(time[p]), half, float(time[max(last, q)]), before, size, rest, rough)


def below_half(time: Array, level: Array, held: bool = False) -> float:
    """Time that a signal from 0 to 1 spends below one half, s; straight between its rows."""
    first, last, steps = level[:-1], level[1:], np.diff(time)
    if held:
        return float(np.sum(steps[first < 0.5]))
    low, high = np.minimum(first, last), np.maximum(first, last)
    wide = high - low
    share = np.clip((0.5 - low) / np.where(wide > 0.0, wide, 1.0), 0.0, 1.0)
    return float(np.sum(steps * np.where(wide > 0.0, share, low < 0.5)))


def rows_of(series: Series, segment: tuple[float, float]) -> tuple[Array, Array]:
    """Times and finite values of a series in a segment."""
    rows = (series.time >= segment[0]) & (series.time <= segment[1]) & np.isfinite(series.values)
    return series.time[rows], series.values[rows]


def _spans(values: Array, wide: int) -> Array:
    """Range of each run of so many rows, or of all where there are fewer, shape (windows,)."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    wide = min(wide, values.size)
    span = maximum_filter1d(values, wide) - minimum_filter1d(values, wide)
    return np.asarray(span[wide // 2 : wide // 2 + values.size - wide + 1])
