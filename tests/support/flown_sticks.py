"""Setpoints of unit size as functions of time: what sticks, missions and identification ask for.

Each moves in bursts with rest between them. Its changes come at any time and know of no row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]
Events = Iterator[tuple[float, float]]

#: Length of a burst, in times of one change, and rest at both ends of a log, s.
BURST, ENDS = (6.0, 20.0), 1.0

#: Corner of the filter of smooth sticks, and ends of a sweep, in changes a time.
CORNER, SWEEP = 0.6, (0.06, 2.0)


def bursts(
    seconds: float, pace: float, rest: float, random: np.random.Generator
) -> list[tuple[float, float]]:
    """Start and stop of each burst, s, with about this share of rest."""
    found, at = [], ENDS
    while at < seconds - ENDS:
        length = pace * random.uniform(*BURST)
        stop = min(at + length, seconds - ENDS)
        found.append((at, stop))
        at = stop + length * rest / (1.0 - rest) * random.uniform(0.5, 1.5)
    return found


def _jumps(start: float, stop: float, pace: float, random: np.random.Generator) -> Events:
    at = start
    while at < stop:
        yield at, float(np.clip(random.normal(), -2.0, 2.0))
        at += pace * (0.25 + random.exponential(0.75))
    yield stop, 0.0


def _doublets(start: float, stop: float, pace: float, random: np.random.Generator) -> Events:
    at = start
    while at < stop:
        width, size = pace * random.uniform(0.5, 1.5), float(random.uniform(0.5, 1.5))
        size *= float(random.choice([-1.0, 1.0]))
        yield at, size
        yield at + width, -size
        yield at + 2.0 * width, 0.0
        at += 2.0 * width + pace * random.uniform(0.5, 2.0)


def _held(time: Array, events: list[tuple[float, float]]) -> Array:
    """The value of the last event before each time; zero before the first."""
    at, values = np.array([(-np.inf, 0.0), *sorted(events)]).T
    return np.asarray(values[np.searchsorted(at, time, side="right") - 1])


def jumping(time: Array, pace: float, rest: float, random: np.random.Generator) -> Array:
    """Steps of random size at random times."""
    parts = bursts(float(time[-1]), pace, rest, random)
    return _held(time, [each for ends in parts for each in _jumps(*ends, pace, random)])


def doublets(time: Array, pace: float, rest: float, random: np.random.Generator) -> Array:
    """One way, then the other, then none."""
    parts = bursts(float(time[-1]), pace, rest, random)
    return _held(time, [each for ends in parts for each in _doublets(*ends, pace, random)])


def smooth(time: Array, pace: float, rest: float, random: np.random.Generator) -> Array:
    """Steps through two lags, as sticks that a hand moves."""
    kept = np.exp(-2.0 * np.pi * CORNER / pace * (time[1] - time[0]))
    steps = jumping(time, pace, rest, random)
    return np.asarray(signal.lfilter([(1.0 - kept) ** 2], [1.0, -2.0 * kept, kept**2], steps))


def chirp(time: Array, pace: float, rest: float, random: np.random.Generator) -> Array:
    """Sweeps of a sine that rise in frequency, as of a flight for identification."""
    found = np.zeros(time.size)
    for start, stop in bursts(float(time[-1]), 3.0 * pace / SWEEP[0] / BURST[0], rest, random):
        rows = (time >= start) & (time < stop)
        low, high = (end / pace for end in SWEEP)
        rise = np.log(high / low) / (stop - start)
        turns = low / rise * np.expm1(rise * (time[rows] - start))
        found[rows] = np.sqrt(2.0) * np.sin(2.0 * np.pi * turns)
    return found


STICKS: dict[str, Callable[[Array, float, float, np.random.Generator], Array]] = {
    "jumps": jumping,
    "doublets": doublets,
    "smooth": smooth,
    "chirp": chirp,
}
