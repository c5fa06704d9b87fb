"""One signal of a loop over time, in SI units, with its origin."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime._base.frozen import ReadOnlyArrays
from deadtime.logs._contents import LogContents, Topic
from deadtime.logs._names import UNITS, Signal

#: A pause of this many usual periods is a gap.
PAUSE = 5.0

#: No log has a pause of a day, s: what follows is a damaged time.
DAY = 86400.0


@dataclass(frozen=True, eq=False)
class Series(ReadOnlyArrays):
    """One signal of a log.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds from the start of the log, strictly increasing.
    values : ndarray, shape (n,)
        In `unit`; NaN where the log holds none.
    unit : str
        ``"rad"``, ``"rad/s"``, ``"m"``, ``"m/s"``, or the unit of the log for an actuator; empty
        if it has none.
    source : str
        Its name in the log, for example ``"ATT.DesRoll"``.
    conversion : str
        What was done to the values, for example ``"ATT.DesRoll [deg] to rad"``; empty for nothing.
    """

    time: Array
    values: Array
    unit: str
    source: str
    conversion: str = ""

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        unit = f" [{self.unit}]" if self.unit else ""
        return f"<Series {self.source}{unit}: {len(self)} rows at {self.rate:.4g} Hz>"

    @property
    def topic(self) -> str:
        """The message of the log that holds it."""
        return self.source.partition(".")[0]

    @property
    def period(self) -> float:
        """Median time between rows, s."""
        return float(np.median(np.diff(self.time))) if len(self) > 1 else np.inf

    @property
    def rate(self) -> float:
        """Rows a second, from the median time between them, Hz."""
        return 1.0 / self.period

    @property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Pauses of more than five usual periods: start and stop, s."""
        pauses = np.flatnonzero(np.diff(self.time) > PAUSE * self.period)
        return tuple((float(self.time[k]), float(self.time[k + 1])) for k in pauses)


def first_series(
    contents: LogContents, signals: Sequence[Signal], start: float
) -> tuple[Series | None, int]:
    """The first of the alternatives that is in the log, and how many of its rows were left out."""
    for signal in signals:
        topic = contents.topics.get(signal.topic)
        if topic is not None and all(name in topic.columns for name in signal.columns):
            series, lost = _series(signal, topic, start)
            if len(series) > 1 and np.isfinite(series.values).any():
                return series, lost
    return None, 0


def _series(signal: Signal, topic: Topic, start: float) -> tuple[Series, int]:
    with np.errstate(all="ignore"):  # damaged logs hold any number
        columns = [np.asarray(topic.columns[name], dtype=float) for name in signal.columns]
        values = columns[0] if signal.derive is None else signal.derive(*columns)
        label = topic.units.get(signal.columns[0], "") if signal.derive is None else ""
        logged = label if label in UNITS else signal.unit
        unit, factor = UNITS.get(logged, (logged, 1.0))
        values = np.asarray(values * (factor * signal.sign), dtype=float)
    values[~np.isfinite(values)] = np.nan
    time = np.asarray(topic.time, dtype=float) - start
    kept = increasing(time)
    source = f"{signal.topic}.{signal.columns[0]}"
    if signal.columns[0].partition("[")[0] == signal.columns[-1].partition("[")[0]:
        source += f"…{signal.columns[-1]}" * (len(signal.columns) > 1)
    steps = [signal.rule] if signal.rule else []
    if factor != 1.0:
        steps.append(f"[{logged}] to {unit}")
    conversion = f"{source} {', '.join(steps)}" if steps else ""
    series = Series(time[kept], values[kept], unit, source, conversion)
    return series, int(kept.size - np.count_nonzero(kept))


def increasing(time: Array, *, last: bool = False) -> Mask:
    """The most rows whose times increase strictly, with no pause of a day.

    One wrong time far ahead then takes no later rows with it, and one far behind no earlier ones.
    Of rows with one time the first is kept, which is a measured value, or with `last` the last: of
    states that change at one time it is the one that stays.
    """
    kept = np.isfinite(time)
    rows = np.flatnonzero(kept)
    repeated = np.flatnonzero(np.diff(time[rows]) == 0.0) + (0 if last else 1)
    rows = np.delete(rows, repeated)
    if np.any(np.diff(time[rows]) <= 0.0):
        rows = rows[_longest(time[rows].tolist())]
    edges = [0, *(np.flatnonzero(np.diff(time[rows]) > DAY) + 1).tolist(), rows.size]
    longest = int(np.argmax(np.diff(edges)))
    kept[:] = False
    kept[rows[edges[longest] : edges[longest + 1]]] = True
    return kept


def _longest(values: list[float]) -> list[int]:
    """Places of the longest increasing part (patience sorting)."""
    lowest: list[float] = []  # the least last value of a part of each length
    last: list[int] = []
    before = []
    for place, value in enumerate(values):
        at = bisect_left(lowest, value)
        before.append(last[at - 1] if at else -1)
        if at == len(lowest):
            lowest.append(value)
            last.append(place)
        else:
            lowest[at] = value
            last[at] = place
    found, place = [], last[-1] if last else -1
    while place >= 0:
        found.append(place)
        place = before[place]
    return found[::-1]
