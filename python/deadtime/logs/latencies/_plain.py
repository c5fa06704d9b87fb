"""The plain numbers of the field for the time from setpoint to response.

They are no estimates of one number. Of a plant with delay T and one lag L the three methods give

* masked cross-correlation (Padfield 2012): the equivalent delay where the setpoint has its power,
  T + atan(w L)/w, so between T for fast changes and T + L for slow ones;
* half of the deconvolved step: T + 0.69 L;
* half to half over the moves of the setpoint: T + 0.69 L after jumps, T + L after slow ramps.

So a fit is tested by what the same method gives on the response of the fitted plant to the same
setpoint at the same rows (`differences`), and not by its delay and lag.

Intervals are 95 % ones: by the jackknife over blocks of the record or groups of its windows, with
the t quantile of their number less one, and by order statistics over moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import between as ends_of, shown
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime._base.verdicts import rough
from deadtime.logs._series import Series
from deadtime.logs.latencies._commands import Between
from deadtime.logs.latencies._correlation import (
    FEWEST,
    Grid,
    correlation_of,
    grid_of,
    independent_rows,
    peak_of,
)
from deadtime.logs.latencies._deconvolution import half_of_step
from deadtime.logs.latencies._moves import COVERAGE, Moves, aligned, median_of, moves_of
from deadtime.logs.latencies._setpoint_moves import Move

#: Standard deviations of a correlation without any relation that a peak has to be above.
ABOVE = 4.0

#: Widest half of an interval that still says something, as a share of the longest time.
WIDEST = 0.5


@dataclass(frozen=True, eq=False)
class PlainTime(ReadOnlyArrays):
    """One plain number.

    Attributes
    ----------
    name : str
        ``"cross-correlation"``, ``"deconvolved step"`` or ``"moves"``.
    meaning : str
        What it is of.
    value : float
        s; NaN where the record determines none.
    interval : (float, float)
        95 % interval of its own scatter, s; NaN where that is not known.
    quality : float
        Of the cross-correlation the coefficient; NaN for others.
    count : int
        Blocks, windows or moves.
    reason : str
        Why there is no value, or no interval; empty where there are both.
    """

    name: str
    meaning: str
    value: float
    interval: tuple[float, float]
    quality: float
    count: int
    reason: str = ""
    _parts: Array = field(default_factory=lambda: np.empty(0), repr=False)

    def line(self) -> str:
        """The number in one line."""
        if math.isnan(self.value):
            return f"{self.name}: none, {self.reason}"
        low, high = self.interval
        error = 0.25 * (high - low)
        known = shown(self.value, error, "s") if error < math.inf else rough(self.value, "s")
        known = f"{self.name}: {known}"
        if self.name == "cross-correlation":
            known += f", coefficient {self.quality:.2f}"
        if math.isnan(low):
            return f"{known}, {self.reason}"
        if high == math.inf:
            return f"{known} (95 %: {rough(low, 's')} or more)"
        return f"{known} (95 %: {ends_of(low, high, error, 's')})"

    def to_dict(self) -> dict[str, Any]:
        """The number as plain values for JSON."""
        names = ("name", "meaning", "value", "interval", "quality", "count", "reason")
        return plain_fields({name: getattr(self, name) for name in names})


@dataclass(frozen=True, eq=False)
class PlainTimes(ReadOnlyArrays):
    """The three plain numbers of a loop, from the setpoint to the response.

    Attributes
    ----------
    correlation, step, moves : PlainTime
        Peak of the masked cross-correlation, half of the deconvolved step, and half to half over
        the moves of the setpoint.
    aligned : Moves
        These moves.
    """

    correlation: PlainTime
    step: PlainTime
    moves: PlainTime
    aligned: Moves

    @property
    def all(self) -> tuple[PlainTime, PlainTime, PlainTime]:
        """The three numbers."""
        return (self.correlation, self.step, self.moves)

    def to_dict(self) -> dict[str, Any]:
        """The numbers as plain values for JSON."""
        return {time.name: time.to_dict() for time in self.all}


@dataclass(frozen=True)
class Difference:
    """A plain number of a log less that of the fitted plant.

    Attributes
    ----------
    name : str
        The method.
    measured, modelled : float
        Both numbers, s.
    interval : (float, float)
        95 % interval of the difference, s, from the same blocks, windows or moves of both.
    disagrees : bool
        Whether zero lies outside of it; false where it is not known.
    """

    name: str
    measured: float
    modelled: float
    interval: tuple[float, float]
    disagrees: bool

    def to_dict(self) -> dict[str, Any]:
        """The difference as plain values for JSON."""
        return plain_fields(vars(self))


def plain_times(
    setpoint: Series,
    response: Series,
    segments: Sequence[tuple[float, float]],
    *,
    longest: float,
    between: Between,
    moves: Sequence[Move] | None = None,
) -> PlainTimes:
    """The plain numbers of a loop.

    Parameters
    ----------
    setpoint, response : Series
        Both signals; the response may be that of a fitted plant.
    segments : sequence of (float, float)
        Where the setpoint is followed, s from the start of the log.
    longest : float
        Longest time from setpoint to response that is looked for, s.
    between : {"held", "straight"}
        Whether the setpoint holds from row to row, or is straight between rows.
    moves : sequence of Move, optional
        Moves that were found before; by default they are looked for.

    Returns
    -------
    PlainTimes

    Examples
    --------
    >>> import numpy as np
    >>> from deadtime.logs import Series
    >>> from deadtime.logs import plain_times
    >>> time = np.arange(0.0, 60.0, 0.02)
    >>> sticks = np.repeat(np.random.default_rng(1).standard_normal(60), 50)
    >>> asked = Series(time, sticks, "rad", "asked")
    >>> response = Series(time + 0.12, sticks, "rad", "response")
    >>> found = plain_times(asked, response, [(1.0, 59.0)], longest=1.0, between="straight")
    >>> [round(plain.value, 2) for plain in found.all]
    [0.12, 0.12, 0.12]
    """
    grid = grid_of(setpoint, response, segments, between == "held")
    if moves is None:
        found = moves_of(setpoint, response, segments, longest=longest, between=between)
    else:
        found = aligned(moves, setpoint, response, between=between)
    few = (
        ""
        if np.isfinite(found.interval[0])
        else "the setpoint moves too few times for a confidence interval"
    )
    of_moves = PlainTime(
        "moves", "delay + 0.69 lag after jumps, delay + lag after ramps", found.median,
        found.interval, math.nan, found.count, found.reason or few, found.times,
    )  # fmt: skip
    return PlainTimes(_by_correlation(grid, longest), _by_step(grid, longest), of_moves, found)


def differences(measured: PlainTimes, modelled: PlainTimes) -> tuple[Difference, ...]:
    """What each method gives for the log, less what it gives for the fitted plant.

    Parameters
    ----------
    measured, modelled : PlainTimes
        Of the same setpoint and segments, with the moves of the first in both.

    Returns
    -------
    tuple of Difference
        Of the methods that give both numbers. One of twenty disagrees although the fit is right.
    """
    found = []
    for row, other in zip(measured.all, modelled.all, strict=True):
        if math.isnan(row.value) or math.isnan(other.value) or row._parts.size != other._parts.size:
            continue
        parts = row._parts - other._parts
        if row.name == "moves":
            interval = median_of(parts[np.isfinite(parts)])[1]
        else:
            interval = _interval(row.value - other.value, parts)
        low, high = interval
        found.append(
            Difference(row.name, row.value, other.value, interval, low > 0.0 or high < 0.0)
        )
    return tuple(found)


def _by_correlation(grid: Grid, longest: float) -> PlainTime:
    """The peak of the masked cross-correlation."""
    name, meaning = "cross-correlation", "equivalent delay at the frequencies of the setpoint"
    found = correlation_of(grid, longest)
    value, height = peak_of(found.lags, found.coefficient)
    rows = independent_rows(grid, longest)
    blocks = len(found.without)

    def none(why: str) -> PlainTime:
        return PlainTime(name, meaning, math.nan, (math.nan, math.nan), height, blocks, why)

    if math.isnan(height) or rows <= ABOVE:
        return none("the setpoint or the response moves too little")
    if height < ABOVE / math.sqrt(rows):
        return none(
            f"a correlation of {height:.2f} may be chance, because both signals move so slowly "
            f"that the rows count only as {rows:.0f} independent rows"
        )
    if math.isnan(value):
        return none("the correlation is largest at the longest time that is tried")
    parts = np.array([peak_of(found.lags, correlation)[0] for correlation in found.without])
    return _with_interval(name, meaning, value, parts, height, blocks, longest)


def _by_step(grid: Grid, longest: float) -> PlainTime:
    """Half of the deconvolved step."""
    name, meaning = "deconvolved step", "delay and 0.69 lag"
    value, parts, count, why = half_of_step(grid, longest)
    if why:
        return PlainTime(name, meaning, value, (math.nan, math.nan), math.nan, count, why)
    return _with_interval(name, meaning, value, parts, math.nan, count, longest)


def _with_interval(
    name: str, meaning: str, value: float, parts: Array, quality: float, count: int, longest: float
) -> PlainTime:
    """The number with its interval, or none where its scatter is as wide as what is looked for."""
    low, high = _interval(value, parts)
    if math.isnan(low):
        few = "there are too few parts for an interval"
        return PlainTime(name, meaning, value, (low, high), quality, count, few, parts)
    if 0.5 * (high - low) > WIDEST * longest:
        why = "the parts of the log contradict one another"
        return PlainTime(name, meaning, math.nan, (math.nan, math.nan), quality, count, why)
    return PlainTime(name, meaning, value, (low, high), quality, count, "", parts)


def _interval(value: float, parts: Array) -> tuple[float, float]:
    """The interval of the jackknife; NaN where a part has no number or there are too few."""
    from scipy.special import stdtrit

    if parts.size < FEWEST or not np.isfinite(parts).all():
        return math.nan, math.nan
    error = math.sqrt((parts.size - 1) * float(np.var(parts)))
    reach = float(stdtrit(parts.size - 1, 0.5 * (1.0 + COVERAGE))) * error
    return value - reach, value + reach
