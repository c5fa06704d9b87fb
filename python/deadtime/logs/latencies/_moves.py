"""All moves of a setpoint, aligned, and the response to them.

A move is a change from one stretch in which the setpoint rests, or moves slowly, to the next. Its
zero of time is where half of the change of the setpoint is reached. The response is scaled by
the size of the change. Its time is that at which it passes half of its own change: with noise it
passes more than once, so the time spent below half counts, which is the crossing where there is
one. After a jump that is delay + 0.69 lag for a plant of one lag, after a slow ramp delay + lag.

The median over n moves lies between the k-th and the (n + 1 - k)-th time with a probability of
1 - 2 P(B < k), B binomial of n and 1/2, whatever the distribution (the sign test).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import between as ends_of, shown, stated
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime.logs._series import Series
from deadtime.logs.latencies._commands import Between
from deadtime.logs.latencies._correlation import correlation_of, grid_of, peak_of, value_at
from deadtime.logs.latencies._setpoint_moves import (
    FOLLOWED,
    Move,
    below_half,
    least_size,
    moves_in,
    rows_of,
)

#: How long a setpoint rests before and after a move, in rough times from setpoint to response: the
#: longest with which there are enough moves. A response measured too early has not come all the
#: way, and in most flights the setpoint hardly rests: a slow swing to the other side is a move too.
REST, ENOUGH = (4.0, 3.0, 2.0, 1.5, 1.0), 12

#: Fewest rows of the slower series in such a rest.
ROWS = 2.0

#: Where the levels of the response are read, in rough times after the rests of the setpoint.
LATER = 0.5

#: Least change of the response, as a share of that of the setpoint, that is an answer to it.
ANSWERED = 0.2

#: The common time axis: its start, in rough times, its points, and the share of the moves that a
#: median at one point needs.
BEFORE, POINTS, SHARE = 3.0, 241, 0.5

#: Coverage that the interval of the median has at least; fewer than six moves do not allow it.
COVERAGE = 0.95


@dataclass(frozen=True, eq=False)
class Moves(ReadOnlyArrays):
    """The response of a loop to all moves of its setpoint.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Time from half of the change of the setpoint, s.
    setpoint, response, lower, upper : ndarray, shape (n,)
        Medians of setpoint and response, and the quartiles of the response, as shares of the
        change of the setpoint; NaN where fewer than half of the moves are followed.
    responses : ndarray, shape (count, n)
        The response to each; NaN after the setpoint moves on.
    times, sizes, starts : ndarray, shape (count,)
        Of each move the time from half of the change of the setpoint to half of that of the
        response, s, infinite where the response does not answer; the size of the change in the
        unit of the setpoint; and when, s from the start of the log.
    median : float
        Median of the times, s; NaN where there is none.
    interval : (float, float)
        Its interval by order statistics, s; NaN for fewer than six moves.
    coverage : float
        Probability with which that interval holds, 0.95 or more; NaN without one.
    least : float
        Size from which a change counts as a move, in the unit of the setpoint.
    moves : tuple of Move
        The moves.
    reason : str
        Why there is no time; empty where there is one.

    Examples
    --------
    >>> import numpy as np
    >>> from deadtime.logs import Series
    >>> from deadtime.logs import moves_of
    >>> time = np.arange(0.0, 60.0, 0.02)
    >>> asked = Series(time, np.floor(time / 2.0) % 2.0, "rad", "asked")
    >>> response = Series(time, np.floor((time - 0.1) / 2.0) % 2.0, "rad", "response")
    >>> found = moves_of(asked, response, [(0.0, 59.0)], longest=1.0)
    >>> found.count, abs(found.median - 0.1) < 0.011
    (29, True)
    """

    time: Array
    setpoint: Array
    response: Array
    lower: Array
    upper: Array
    responses: Array
    times: Array
    sizes: Array
    starts: Array
    median: float
    interval: tuple[float, float]
    coverage: float
    least: float
    moves: tuple[Move, ...] = field(repr=False)
    reason: str = ""

    @property
    def count(self) -> int:
        """How many moves there are."""
        return len(self.moves)

    def shown(self, time: float) -> str:
        """A time with the digits that the interval of the median leaves, such as ``"125 ms"``."""
        error = 0.25 * (self.interval[1] - self.interval[0])
        return shown(time, error if math.isfinite(error) else 0.0, "s")

    def headline(self) -> str:
        """The time in one line."""
        if self.reason:
            return f"none: {self.reason}"
        known = f"{self.count} moves, from half of the setpoint's change to half of the response"
        low, high = self.interval
        if math.isnan(low):
            return (
                f"{known} {stated(self.median, 0.0, 's')}, without a confidence interval, "
                "because the setpoint moves too few times"
            )
        error = 0.25 * (high - low)
        covered = f"{100.0 * self.coverage:.0f} %"
        return (
            f"{known} {stated(self.median, error, 's')} "
            f"({covered}: {ends_of(low, high, error, 's')})"
        )

    def to_dict(self) -> dict[str, Any]:
        """The times as plain values for JSON; without the aligned rows."""
        names = ("count", "median", "interval", "coverage", "least", "times", "sizes", "starts")
        return plain_fields({name: getattr(self, name) for name in (*names, "reason")})


def moves_of(
    setpoint: Series,
    response: Series,
    segments: Sequence[tuple[float, float]],
    *,
    longest: float,
    between: Between = "straight",
) -> Moves:
    """Find all moves of a setpoint and align the response to them.

    Parameters
    ----------
    setpoint, response : Series
        Both signals of a loop.
    segments : sequence of (float, float)
        Where the setpoint is followed, s from the start of the log.
    longest : float
        The longest time from setpoint to response that is looked for, s.
    between : {"held", "straight"}, optional
        Whether the setpoint holds from row to row, or is straight between rows.

    Returns
    -------
    Moves
        With no time and a reason where there are no moves.
    """
    least = least_size(setpoint, response, segments, longest)
    held = between == "held"
    grid = grid_of(setpoint, response, segments, held)
    found = correlation_of(grid, longest)
    rough, _ = peak_of(found.lags, found.coefficient)
    rows = ROWS * max(setpoint.period, response.period)
    scale = max(rough if rough > 0.0 else 0.25 * longest, rows)
    best: list[Move] = []
    for rests in REST:
        moves = [
            move
            for segment in segments
            for move in moves_in(setpoint, segment, (rests * scale, scale), least, held)
        ]
        if len(moves) > len(best):
            best = moves
        if len(best) >= ENOUGH:
            break
    return aligned(best, setpoint, response, between=between, least=least)


def aligned(
    moves: Sequence[Move],
    setpoint: Series,
    response: Series,
    *,
    between: Between = "straight",
    least: float = math.nan,
) -> Moves:
    """Any response, such as that of a fitted plant, to moves that were found before."""
    if not moves:
        empty = np.empty(0)
        why = "the setpoint never moves from rest to rest by more than the noise"
        nothing = (math.nan, math.nan)
        return Moves(
            empty, empty, empty, empty, empty, np.empty((0, 0)), empty, empty, empty,
            math.nan, nothing, math.nan, least, (), why,
        )  # fmt: skip
    rough = moves[0].rough
    time = np.linspace(-BEFORE * rough, FOLLOWED * rough, POINTS)
    rows = [_response_to(move, response, time) for move in moves]
    asked = [_scaled(move, value_at(setpoint, move.half + time, between == "held"), time)
             for move in moves]  # fmt: skip
    responses = np.stack([row for row, _ in rows])
    times = np.array([at for _, at in rows])
    sizes, starts = (np.array([getattr(move, name) for move in moves]) for name in ("size", "half"))
    lower, middle, upper = _quartiles(responses)
    median, interval, coverage = median_of(times[~np.isnan(times)])
    reason = ""
    if not math.isfinite(median):
        answered = int(np.count_nonzero(np.isfinite(times)))
        reason = f"the response follows {answered} of {len(moves)} moves of the setpoint"
        median, interval, coverage = math.nan, (math.nan, math.nan), math.nan
    return Moves(
        time, _quartiles(np.stack(asked))[1], middle, lower, upper, responses, times, sizes,
        starts, median, interval, coverage, least, tuple(moves), reason,
    )  # fmt: skip


def median_of(times: Array) -> tuple[float, tuple[float, float], float]:
    """Median, its interval by order statistics, and the coverage of that; NaN below six times."""
    from scipy.special import bdtr

    n = times.size
    if n == 0:
        return math.nan, (math.nan, math.nan), math.nan
    ordered = np.sort(times)
    # The mean of the two in the middle, either of which may be infinite.
    median = 0.5 * float(ordered[(n - 1) // 2] + ordered[n // 2])
    below = bdtr(np.arange(n), n, 0.5)
    k = int(np.count_nonzero(below <= 0.5 * (1.0 - COVERAGE)))
    if k == 0:
        return median, (math.nan, math.nan), math.nan
    coverage = 1.0 - 2.0 * float(below[k - 1])
    return median, (float(ordered[k - 1]), float(ordered[n - k])), coverage


def _response_to(move: Move, response: Series, axis: Array) -> tuple[Array, float]:
    """The response to one move on the axis, and its time; NaN where it has no rows."""
    later, part = LATER * move.rough, 0.5 * move.rest
    start, stop = move.start + later, move.stop + later
    time, values = rows_of(response, (move.start - move.rest, stop))
    early = values[(time >= start - part) & (time <= start)]
    late = values[time >= stop - part]
    if not (early.size and late.size):
        return np.full(axis.shape, np.nan), math.nan
    level = float(np.median(early))
    shown = np.interp(move.half + axis, time, values)
    shown = _scaled(move, shown, axis, level)
    change = float(np.median(late)) - level
    if change / move.size < ANSWERED:
        return shown, math.inf
    kept = time >= start - part
    time, share = time[kept], (values[kept] - level) / change
    return shown, float(time[0]) + below_half(time, share) - move.half


def _scaled(move: Move, values: Array, axis: Array, level: float | None = None) -> Array:
    """Values as shares of the move, and NaN where it is not followed."""
    share = (values - (move.level if level is None else level)) / move.size
    at = move.half + axis
    outside = (at > move.stop + LATER * move.rough) | (at < move.start - move.rest)
    return np.asarray(np.where(outside, np.nan, share))


def _quartiles(rows: Array) -> Array:
    """Quartiles and median of each column that enough rows have, shape (3, n)."""
    found = np.full((3, rows.shape[1]), np.nan)
    enough = np.mean(np.isfinite(rows), axis=0) >= SHARE
    if enough.any():
        found[:, enough] = np.nanpercentile(rows[:, enough], [25.0, 50.0, 75.0], axis=0)
    return found
