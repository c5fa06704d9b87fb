"""The parts of a loop that are fitted: those in which its command moves the most."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs._log import Log, LogLoop
from deadtime.logs._names import Kind, Windows
from deadtime.logs._windows import outside, shared
from deadtime.logs.latencies._commands import Command
from deadtime.recordings import Recording

#: Fewest rows of a window, most rows that are fitted together, and most runs of windows that they
#: come from: more are surer and take longer.
FEWEST, MOST, TOGETHER = 24, 1200, 3

#: Movement of a window, as a share of the largest, below which it ends a run.
STILL = 0.1

#: Length of a window of each kind of loop, s.
LENGTHS: dict[str, float] = {"rate": 4.0, "attitude": 8.0, "velocity": 12.0, "position": 20.0}

#: Share of that length in which a response settles after commands that are not in the log.
SETTLES = 0.05

#: Longest time from command to response that is looked for, as a share of that length.
LONGEST = 0.2

#: Rows are averaged over this share of that length: more takes less time and rounds off the
#: response.
AVERAGED = 1e-3

#: Most parts of a recording, and fewest rows of one.
PARTS, ROWS_OF_A_PART = 8, 60

#: Steps of this many usual periods within averaged rows are gaps.
GAP = 1.5


class Window(NamedTuple):
    """A part of a loop.

    Attributes
    ----------
    start, stop : float
        s from the start of the log.
    recording : Recording
        Its rows, averaged where they are many.
    movement : float
        Deviation of the command from a straight line.
    segment : int
        The segment of the log that it is a part of.
    """

    start: float
    stop: float
    recording: Recording
    movement: float
    segment: int = 0


def windows_of(log: Log, loop: LogLoop, command: Command) -> list[Window]:
    """All windows of a loop, in order, without the time after pauses of the log."""
    told = loop.signals[command]
    settles = SETTLES * LENGTHS[loop.kind]
    pauses = [(low, high + settles) for low, high in sorted([*told.gaps, *log.gaps])]
    segments = shared(list(loop.segments), outside(pauses))
    found = []
    for segment, ends in enumerate(segments):
        for start, stop in _divided(*ends, LENGTHS[loop.kind]):
            inside = (loop.response.time >= start) & (loop.response.time <= stop)
            if np.count_nonzero(inside & np.isfinite(loop.response.values)) >= FEWEST:
                part = window_of(loop.recording(start, stop, command=command), loop.kind)
                found.append(part._replace(start=start, stop=stop, segment=segment))
    return found


def _divided(start: float, stop: float, length: float) -> Windows:
    """A segment in equal parts of about some length, s."""
    count = max(1, round((stop - start) / length))
    return list(pairwise(np.linspace(start, stop, count + 1).tolist()))


def window_of(part: Recording, kind: Kind | None = None) -> Window:
    """A recording as a window."""
    told = part.command if part.command is not None else part.reference
    line = np.polynomial.Polynomial.fit(part.time, told, 1)
    moves = float(np.std(told - line(part.time)))
    rows = part if kind is None else averaged(part, kind)
    return Window(float(part.time[0]), float(part.time[-1]), rows, moves)


def averaged(part: Recording, kind: Kind) -> Recording:
    """The recording with means of neighbouring rows of the output, where they are many.

    The mean of the output over a time T is that at its middle but for its curvature: to
    (omega T)²/24, and without a delay.
    """
    over = AVERAGED * LENGTHS[kind]
    together = int(over / part.sample_time + 1e-6)
    if together < 2 or part.sent is None:
        return part
    count = len(part) // together * together
    rows = part.time[:count].reshape(-1, together)
    whole = np.ptp(rows, axis=1) < GAP * (together - 1) * part.sample_time
    mean = _mean(part.output[:count], together)[whole]
    if mean.size < FEWEST:
        return part
    last = np.arange(together - 1, count, together)[whole]
    return Recording(
        rows.mean(axis=1)[whole],
        part.reference[last],
        mean,
        units=part.units,
        source=part.source,
        sent=part.sent,
    )


def _mean(values: Array, together: int) -> Array:
    return np.asarray(values.reshape(-1, together).mean(axis=1))


def best_of(windows: Sequence[Window]) -> Windows:
    """Runs of neighbouring windows to fit together, in order: start and stop of each, s.

    Those that move the most, up to some number of rows.
    """
    least = STILL * max((one.movement for one in windows), default=0.0)
    left = [k for k, one in enumerate(windows) if one.movement > least]
    chosen: Windows = []
    rows = MOST
    while left and len(chosen) < TOGETHER:
        runs = [run for run in _runs(windows, left, rows) if run]
        if not runs:
            break
        best = max(runs, key=lambda run: sum(windows[k].movement ** 2 for k in run))
        chosen.append((windows[best[0]].start, windows[best[-1]].stop))
        rows -= sum(len(windows[k].recording) for k in best)
        left = [k for k in left if k not in best]
    if left and not chosen:
        most = max(left, key=lambda k: windows[k].movement)
        chosen = [(windows[most].start, windows[most].stop)]
    return sorted(chosen)


def _runs(windows: Sequence[Window], places: Sequence[int], most: int) -> list[list[int]]:
    """From each of these windows on, as many neighbours as have so many rows together."""
    runs = []
    for first, place in enumerate(places):
        run: list[int] = []
        rows = 0
        for k in places[first:]:
            rows += len(windows[k].recording)
            beside = k == place + len(run) and windows[k].segment == windows[place].segment
            if not beside or rows > most:
                break
            run.append(k)
        runs.append(run)
    return runs


def rows_of_a_window(loop: LogLoop) -> float:
    """About how many rows a window of this loop has."""
    return min(LENGTHS[loop.kind] / loop.response.period, 1.0 / AVERAGED)


def parts_of(recording: Recording) -> tuple[Recording, list[Window]]:
    """One recording, and equal parts of it, each with the commands before it."""
    assert recording.command is not None
    sent = recording.sent or (recording.time, recording.command)
    whole = Recording(
        recording.time, recording.reference, recording.output,
        units=recording.units, source=recording.source, sent=sent,
    )  # fmt: skip
    count = min(PARTS, max(1, len(recording) // ROWS_OF_A_PART))
    edges = np.linspace(recording.time[0], recording.time[-1], count + 1).tolist()
    return whole, [window_of(whole.window(*ends)) for ends in pairwise(edges)]
