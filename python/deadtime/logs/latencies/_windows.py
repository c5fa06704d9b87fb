"""The windows of a loop that promise the most about its delay.

In a window of length L the response y is compared with that of a plant with few numbers: gain,
offset, trim, and a delay T that stands for delay and lag. The Cramér-Rao bound of T for residuals
of variance v is

    std(T) >= sqrt(v c / sum(d_i^2)),

d the slope of the response with what gain, offset and trim explain taken out, and
c = (1 + rho)/(1 - rho) for residuals of lag-1 autocorrelation rho, which are worth fewer rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation import HeldResponse
from deadtime.logs._log import LogLoop
from deadtime.logs.latencies._controller import LENGTHS, Between, Command
from deadtime.recordings import Recording

#: Fewest and most rows of a window.
FEWEST, MOST = 24, 6000

#: Shares of that length that are tried, and of its own by which one window comes after another.
SIZES, SHIFT = (1.0, 0.5), 0.5

#: Parts that are looked at, those whose command moves the most.
LOOKED_AT = 64

#: Parts of a recording in which its time is compared.
PARTS = 8

#: Delays and lags that are tried, in rows.
TRIED = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)

#: Longest time from command to response, as a share of the window.
LONGEST = 0.2

#: Further windows that are used with the best, and by how much less they may promise.
FURTHER, LESS = 2, 3.0

#: Windows that are compared with those.
COMPARED = 2

#: A window says something if it promises the time to this share of itself, or of a row.
SHARE, OF_A_ROW = 0.5, 2.0

#: Size of a response, as a share of the command, that is rounding.
TINY = 1e-12

#: Share of the variance of the response that a command has to explain, beyond what noise would.
EXPLAINED = 0.1


class Window(NamedTuple):
    """A part of a loop's recording.

    Attributes
    ----------
    start, stop : float
        s from the start of the log.
    recording : Recording
        The part.
    promise : float
        Standard error of the time from command to response that the part promises, s.
    time : float
        That time, roughly, s.
    explained : float
        Share of the variance of the response that the command explains.
    """

    start: float
    stop: float
    recording: Recording
    promise: float
    time: float
    explained: float

    @property
    def tells(self) -> bool:
        """Whether the window says anything about the time."""
        row = self.recording.sample_time
        return self.explained > EXPLAINED and self.promise < max(SHARE * self.time, OF_A_ROW * row)

    def is_apart(self, others: Sequence[Window]) -> bool:
        """Whether the window shares no time with these."""
        return all(self.stop <= other.start or self.start >= other.stop for other in others)


class _Shape(NamedTuple):
    """The best of the tried responses: sum of squares left, time, gain, residuals, slope."""

    square: float
    time: float
    gain: float
    left: Array
    turn: Array


def seen_windows(loop: LogLoop, command: Command, between: Between | None) -> list[Window]:
    """The windows with most movement, the one that promises most first; none without rows."""
    parts = sorted(_parts(loop, command, between), key=_movement, reverse=True)
    found = [window_of(part, command == "actuator") for part in parts[:LOOKED_AT]]
    return sorted(found, key=lambda one: one.promise if one.tells else np.inf)


def best_of(found: Sequence[Window]) -> list[Window]:
    """The windows to fit."""
    chosen = list(found[:1])
    for one in found[1:]:
        if one.is_apart(chosen) and one.tells and one.promise < LESS * chosen[0].promise:
            chosen.append(one)
        if len(chosen) > FURTHER:
            break
    return chosen


def others_of(found: Sequence[Window], chosen: Sequence[Window]) -> list[Window]:
    """The windows beside those to fit that promise the most, which are to agree with them."""
    apart: list[Window] = list(chosen)
    for one in found:
        if one.tells and one.is_apart(apart):
            apart.append(one)
    return apart[len(chosen) :][:COMPARED]


def parts_of(recording: Recording, integrates: bool) -> list[Window]:
    """Equal parts of a recording that tell something; none of a short one."""
    start, stop = float(recording.time[0]), float(recording.time[-1])
    edges = np.linspace(start, stop, PARTS + 1).tolist()
    rows = np.searchsorted(recording.time, edges)
    if np.min(np.diff(rows)) < FEWEST:
        return []
    found = [window_of(recording.window(*ends), integrates) for ends in pairwise(edges)]
    return [one for one in found if one.tells]


def rows_of_a_window(loop: LogLoop) -> float:
    """About how many rows a window of this loop has."""
    return min(LENGTHS[loop.kind] / loop.response.period, MOST)


def _parts(loop: LogLoop, command: Command, between: Between | None) -> list[Recording]:
    """Parts of the segments of a loop, as long as its kind asks for, half over one another."""
    longest = min(LENGTHS[loop.kind], MOST * loop.response.period)
    parts = []
    for (start, stop), length in product(loop.segments, [size * longest for size in SIZES]):
        shift = SHIFT * length
        count = max(1, int(np.floor((stop - start - length) / shift + 1e-9)) + 1)
        for k in range(count):
            low = start + k * shift
            # The last part of a segment takes what is left of it.
            high = stop if k == count - 1 and stop - low < length + shift else low + length
            inside = np.isfinite(loop.response.values) & (
                (loop.response.time >= low) & (loop.response.time <= high)
            )
            if np.count_nonzero(inside) >= FEWEST:
                parts.append(loop.recording(low, high, command=command, between=between))
    return parts


def _movement(part: Recording) -> float:
    """Deviation of the command of a part from a straight line."""
    return float(np.std(_without(trend_of(part.time), told_by(part))))


def told_by(part: Recording) -> Array:
    """What a recording was told on its rows: its command, or its reference where it has none."""
    return part.reference if part.command is None else part.command


def _without(basis: Array, values: Array) -> Array:
    """What a basis leaves of values, along their last axis."""
    return np.asarray(values - (values @ basis) @ basis.T)


def window_of(part: Recording, integrates: bool) -> Window:
    """A recording as a window, with what it says about the time from command to response."""
    time, output = part.time, part.output
    response = HeldResponse(*(part.sent or (time, told_by(part))))
    row = part.sample_time
    trend = trend_of(time)
    moved = _without(trend, output)
    power = float(moved @ moved)
    best = _Shape(np.inf, 0.0, 0.0, moved, moved)
    delays = np.array(TRIED)
    times = time - delays[:, None] * row
    for lag in TRIED:
        path = response.at(times, lag * row)
        shapes = _without(trend, path.value if integrates else path.rate)
        sizes = np.linalg.norm(shapes, axis=1)
        within = (delays + lag > 0.0) & ((delays + lag) * row < LONGEST * (time[-1] - time[0]))
        moves = sizes > TINY * (1.0 + np.max(np.abs(path.rate), axis=1))
        tried = np.flatnonzero(within & moves)
        if tried.size == 0:
            continue
        gains = shapes[tried] @ moved / sizes[tried]
        squares = power - gains**2
        least = tried[np.argmin(squares)]
        delay, size = float(delays[least]), float(sizes[least])
        unit = shapes[least] / size
        gain = float(unit @ moved)
        left = moved - gain * unit
        if float(left @ left) < best.square:
            slope = path.rate[least]
            if not integrates:
                ahead, behind = (
                    response.at(time - (delay + half) * row, lag * row).rate for half in (0.5, -0.5)
                )
                slope = (behind - ahead) / row
            turn = _without(trend, slope) * (gain / size)
            turn -= unit * float(unit @ turn)
            best = _Shape(float(left @ left), (delay + lag) * row, gain / size, left, turn)
    ends = float(time[0]), float(time[-1])
    if best.gain == 0.0 or power == 0.0:
        return Window(*ends, part, np.inf, 0.0, 0.0)
    left, turn = best.left, best.turn
    variance = variance_of(left)
    information = float(turn @ turn)
    promise = np.sqrt(variance / information) if information > 0.0 else np.inf
    return Window(*ends, part, float(promise), best.time, 1.0 - best.square / power)


def trend_of(time: Array) -> Array:
    """Orthonormal columns of a constant and a line, shape (n, 2)."""
    columns = np.stack([np.ones(time.size), time - time.mean()], axis=1)
    return np.asarray(np.linalg.qr(columns)[0])


def variance_of(left: Array) -> float:
    """Variance of residuals, times the rows that are worth one because they are correlated."""
    square = float(left @ left)
    rho = float(np.clip((left[1:] @ left[:-1]) / max(square, 1e-300), 0.0, 0.999))
    return square / left.size * (1.0 + rho) / (1.0 - rho)
