"""The parts of a loop that are fitted: those in which its command moves the most."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import RecordingError
from deadtime.logs._log import Log, LogLoop
from deadtime.logs._names import Kind, Windows
from deadtime.logs._series import Series
from deadtime.logs._windows import outside, shared
from deadtime.logs.latencies._between import moving_mean, refined
from deadtime.logs.latencies._commands import Command, Sampling
from deadtime.recordings import Recording

#: Fewest rows of a window, most rows that are fitted together, and most runs of windows that they
#: come from: more are surer and take longer.
FEWEST, MOST, TOGETHER = 24, 600, 2

#: Most rows, and most segments, to which the plants of these are fitted then.
ALL, SEGMENTS = 15000, 8

#: Most rows of neighbouring windows whose time is estimated together: more see more of each.
GROUPED = 1600

#: A window is like the others if its response follows to this share of what it does in most, and is
#: as late to this factor and so many rows; and how many others there have to be for that.
FOLLOWS, FACTOR, ROWS_OFF, OTHERS = 0.4, 2.5, 2.0, 4

#: Movement of a window, as a share of the largest, below which it ends a run.
STILL = 0.1

#: Most rows of a window.
ROWS = 400

#: Length of a window of each kind of loop, s.
LENGTHS: dict[str, float] = {"rate": 4.0, "attitude": 8.0, "velocity": 12.0, "position": 20.0}

#: Share of that length in which a response settles after commands that are not in the log.
SETTLES = 0.05

#: Longest time from command to response that is looked for, as a share of that length.
LONGEST = 0.2

#: Commands are used from so much before the first row on, as a share of that length.
BEFORE = 0.25

#: Rows are averaged over this share of that length: more takes less time, and shows less of what is
#: fast.
AVERAGED = 5e-4

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
        Deviation of the command from a straight line, times the share of the response that follows.
    segment : int
        The segment of the log that it is a part of.
    follows : float
        Largest correlation of command and response, squared.
    late : float
        The time by which the response is later there, s.
    """

    start: float
    stop: float
    recording: Recording
    movement: float
    segment: int = 0
    follows: float = 1.0
    late: float = 0.0


def windows_of(log: Log, loop: LogLoop, command: Command, sampling: Sampling) -> list[Window]:
    """All windows of a loop, in order, without the time after pauses of the log."""
    signal = loop.signals[command]
    settles = SETTLES * LENGTHS[loop.kind]
    pauses = [(low, high + settles) for low, high in sorted([*signal.gaps, *log.gaps])]
    segments = shared(list(loop.segments), outside(pauses))
    together = together_of(loop.response, loop.kind)
    length = min(LENGTHS[loop.kind], ROWS * together * loop.response.period)
    found = []
    for segment, ends in enumerate(segments):
        for start, stop in _divided(*ends, length):
            inside = (loop.response.time >= start) & (loop.response.time <= stop)
            if np.count_nonzero(inside & np.isfinite(loop.response.values)) < together * FEWEST:
                continue
            try:
                part = loop.recording(start, stop, command=command)
                rows = prepared(part, loop.kind, sampling, together)
            except RecordingError:  # repeated rows, or gaps
                continue
            follows, late = _follows(rows, LONGEST * LENGTHS[loop.kind])
            moves = movement_of(part) * follows
            found.append(Window(start, stop, rows, moves, segment, follows, late))
    return found


def that_follow(windows: Sequence[Window]) -> list[Window]:
    """The windows in which the response follows the command as it does in most of the others.

    On the ground, in a crash or a flip it does not, and moves the most.
    """
    moving = [window for window in windows if window.movement > 0.0]
    if len(moving) < OTHERS:
        return list(windows)
    follows = float(np.median([window.follows for window in moving]))
    late = float(np.median([window.late for window in moving]))
    kept = []
    for window in windows:
        slack = ROWS_OFF * window.recording.sample_time
        near = late / FACTOR - slack <= window.late <= FACTOR * late + slack
        if near and window.follows >= FOLLOWS * follows:
            kept.append(window)
    return kept


def _follows(part: Recording, longest: float) -> tuple[float, float]:
    """The largest squared correlation of command and response, and how much later that is, s."""
    assert part.sent is not None
    step = part.sample_time
    even = np.arange(part.time[0], part.time[-1], step)
    line = np.polynomial.Polynomial.fit
    command = np.interp(even, *part.sent)
    output = np.interp(even, part.time, part.output)
    command, output = command - line(even, command, 1)(even), output - line(even, output, 1)(even)
    power = float(command @ command) * float(output @ output)
    most = min(int(longest / step) + 1, even.size // 2)
    if power <= 0.0 or most < 1:
        return 0.0, 0.0
    products = np.correlate(output, command[: even.size - most], "valid")
    best = int(np.argmax(products))
    return max(0.0, float(products[best])) ** 2 / power, best * step


def movement_of(part: Recording) -> float:
    """Deviation of the command of a recording from a straight line."""
    command = part.command if part.command is not None else part.reference
    line = np.polynomial.Polynomial.fit(part.time, command, 1)
    return float(np.std(command - line(part.time)))


def _divided(start: float, stop: float, length: float) -> Windows:
    """A segment in equal parts of about some length, s."""
    count = max(1, round((stop - start) / length))
    return list(pairwise(np.linspace(start, stop, count + 1).tolist()))


def together_of(response: Series, kind: Kind) -> int:
    """How many rows of a response are averaged."""
    return max(1, int(AVERAGED * LENGTHS[kind] / response.period + 1e-6))


def prepared(part: Recording, kind: Kind, sampling: Sampling, together: int) -> Recording:
    """The recording with its commands between rows, and means of so many rows of the output.

    The command is averaged over the same time, so that the plant is that of single rows. Those that
    arrive before the first row are left out: the state there is unknown.
    """
    assert part.sent is not None
    first = np.searchsorted(part.sent.time, part.time[0] - BEFORE * LENGTHS[kind])
    sent = part.sent.time[first:], part.sent.values[first:]
    if sampling.between == "straight":
        sent = refined(*sent)
    time, output, reference = part.time, part.output, part.reference
    if together > 1:
        count = len(part) // together * together
        rows = time[:count].reshape(-1, together)
        step = part.sample_time
        whole = np.ptp(rows, axis=1) < GAP * (together - 1) * step
        time, output = rows.mean(axis=1)[whole], _mean(output[:count], together)[whole]
        reference = reference[together - 1 : count : together][whole]
        sent = moving_mean(*sent, sampling.between, together * step)
    if time.size < FEWEST:
        raise RecordingError(
            f"{time.size} rows without gaps are fewer than the {FEWEST} that are needed"
        )
    return Recording(time, reference, output, units=part.units, source=part.source, sent=sent)


def _mean(values: Array, together: int) -> Array:
    return np.asarray(values.reshape(-1, together).mean(axis=1))


def best_of(windows: Sequence[Window]) -> Windows:
    """Runs of neighbouring windows to fit together, in order: start and stop of each, s.

    Those that move the most, up to some number of rows.
    """
    least = STILL * max((window.movement for window in windows), default=0.0)
    left = [k for k, window in enumerate(windows) if window.movement > least]
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


def moving_of(windows: Sequence[Window]) -> list[Window]:
    """The windows in which the command moves."""
    least = STILL * max((window.movement for window in windows), default=0.0)
    return [window for window in windows if window.movement > least]


def grouped(windows: Sequence[Window], most: int) -> list[list[Window]]:
    """About so many groups of neighbouring windows that move, in order, as far as rows allow."""
    least = STILL * max((window.movement for window in windows), default=0.0)
    moving = [k for k, window in enumerate(windows) if window.movement > least]
    size = -(-len(moving) // most)
    groups: list[list[Window]] = []
    last = -2
    for k in moving:
        window = windows[k]
        beside = k == last + 1 and bool(groups) and groups[-1][-1].segment == window.segment
        if beside and len(groups[-1]) < size and _rows([*groups[-1], window]) <= GROUPED:
            groups[-1].append(window)
        else:
            groups.append([window])
        last = k
    return groups


def whole_of(windows: Sequence[Window]) -> Windows:
    """The segments of the windows that move, from the first to the last of them in each.

    Those with the most movement, where there are many or they are long.
    """
    least = STILL * max((window.movement for window in windows), default=0.0)
    parts: dict[int, list[Window]] = {}
    for window in windows:
        if window.movement > least:
            parts.setdefault(window.segment, []).append(window)
    moving = sorted(parts.values(), key=lambda some: -sum(window.movement**2 for window in some))
    chosen: Windows = []
    rows = 0
    for some in moving[:SEGMENTS]:
        kept = some[: max(1, (ALL - rows) * len(some) // max(1, _rows(some)))]
        rows += _rows(kept)
        chosen.append((kept[0].start, kept[-1].stop))
        if rows >= ALL:
            break
    return sorted(chosen)


def _rows(windows: Sequence[Window]) -> int:
    return sum(len(window.recording) for window in windows)


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
    parts = [(ends, whole.window(*ends)) for ends in pairwise(edges)]
    return whole, [Window(*ends, part, movement_of(part)) for ends, part in parts]
