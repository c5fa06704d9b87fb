"""Flights against ArduPilot's Copter as the vehicle itself logged them.

Its DataFlash holds, on its own clock, when a command was computed (the mark, `MAVC`), when it was
told that command (`GUIP`), and how it moved (`XKF1`). Times from the mark to the motion hold what
was added to the delay; the estimate is not told how much that was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np
from numpy.typing import NDArray

from reality.flights import APPROACH, HOLD, REST, STEPS

Array = NDArray[np.float64]

#: The message by which commands are marked.
MARK = 31010

#: Column of the position by axis, and the sign by which it counts as the command does.
POSITIONS = {"height": ("PD", -1.0), "north": ("PN", 1.0)}

#: Column of the velocity that the vehicle was told, cm/s; its rounding, m/s.
TOLD, ROUNDED = {"height": "vZ", "north": "vX"}, 1e-5


def recording_of(path: Path, number: int, axis: str) -> dtm.Recording:
    """A flight of a log: the position of the vehicle, and the commands when they were computed."""
    topics = dtm.open_log(path).contents.topics
    sent, commands, references = marks_of(topics, number)
    distinct = np.diff(sent, prepend=-np.inf) > 0.0
    sent, commands, references = sent[distinct], commands[distinct], references[distinct]
    column, sign = POSITIONS[axis]
    position = topics["XKF1"]
    begin = float(sent[0]) + APPROACH
    rows = (position.time >= begin) & (position.time <= begin + REST + STEPS * HOLD)
    time, first = position.time[rows], float(position.time[rows][0])
    places = np.searchsorted(sent, time, side="right") - 1
    return dtm.Recording(
        time - first,
        references[places],
        sign * position.columns[column][rows],
        units={"output": "m", "reference": "m", "command": "m/s"},
        source=f"{path.name}, flight {number}",
        sent=(sent - first, commands),
    )


def marks_of(topics: Mapping[str, Any], number: int) -> tuple[Array, Array, Array]:
    """When the commands of a flight were computed, they, and the reference at the time."""
    marks = topics["MAVC"]
    own = (marks.columns["Cmd"] == MARK) & (marks.columns["P3"] == number)
    if not own.any():
        raise ValueError(f"no flight {number} is marked in this log")
    return marks.time[own], marks.columns["P1"][own], marks.columns["P2"][own]


def waited(path: Path, number: int, axis: str) -> float:
    """How long commands waited until the vehicle was told them, the mean on its clock, s."""
    topics = dtm.open_log(path).contents.topics
    sent, commands, _ = marks_of(topics, number)
    told = topics["GUIP"]
    after = (told.time >= sent[0]) & (told.time <= sent[-1])
    times, values = told.time[after], 0.01 * told.columns[TOLD[axis]][after]
    first = int(np.argmax(np.abs(values - commands[0]) <= ROUNDED))  # it was told to hover before
    waits: list[float] = []
    before = math.nan
    for time, value in zip(times[first:], values[first:], strict=True):
        place = len(waits)
        if place < sent.size and abs(value - commands[place]) <= ROUNDED:
            waits.append(float(time - sent[place]))
        elif value != before:  # a message may come twice
            raise ValueError(f"flight {number} of {path}: the vehicle was told other commands")
        before = value
    return float(np.mean(waits))
