"""Rows of a recording for the likelihood: outputs that count, commands, and when they are unknown.

A sampled controller sends a command at each of its samples, logged or not. Where rows are further
apart than its samples, the commands between them are those of the controller, computed from the
reference and a straight line between the outputs, if that controller is known and its law holds
on the rows; else the mean of the commands before and after. Where the reference changes between two
such rows, or many rows are missing, the mean command between them is an unknown of the fit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime.loops import ControlLoop, P
from deadtime.recordings import Recording

Array = NDArray[np.float64]

#: Rows are that many samples apart, give or take this share of a sample.
NEAR_WHOLE = 0.25

#: Missing samples in a row from which their mean command is unknown.
HOLE = 3

#: Most unknown commands, as a share of the rows; the longest gaps come first.
MOST_UNKNOWN = 0.1

#: A command is the controller's where the two differ by less than this share of its deviation...
ALIKE = 0.2

#: Spikes of the residuals beyond so many robust deviations are outliers, at most this share of the
#: rows. Half a window of the median that spikes are measured from, in rows.
SPIKE, MOST_SPIKES, HALF_WINDOW = 6.0, 0.15, 2

#: A row that repeats the one before says nothing where the output moves by so many robust deviations.
STALE = 2.0

#: Median absolute deviation of a Gaussian, and the least robust deviation as a share of the plain.
MAD, LEAST_ROBUST = 0.6745, 0.1


class HeldCommands(NamedTuple):
    """Commands that hold from their times on.

    Attributes
    ----------
    time, command : ndarray, shape (m,)
    unknown : tuple of (float, float)
        Times between which the mean command is unknown.
    filled : int
        Commands that were not in the log.
    """

    time: Array
    command: Array
    unknown: tuple[tuple[float, float], ...] = ()
    filled: int = 0


class FlightRows(NamedTuple):
    """What the kernel is given of one recording."""

    time: Array
    output: Array
    used: NDArray[np.bool_]
    command_time: Array
    command: Array
    unknown: tuple[tuple[float, float], ...]
    offset: bool
    trim: bool = False


def with_missing(recording: Recording, loop: ControlLoop, command: Array) -> HeldCommands:
    """The commands of all samples of the controller, from those of the first rows."""
    time = recording.time[: command.size]
    plain = HeldCommands(time, command)
    if loop.sample_time is None or time.size < 2:
        return plain
    apart = np.diff(time) / loop.sample_time
    whole = np.rint(apart)
    gaps = np.flatnonzero((whole > 1.0) & (np.abs(apart - whole) < NEAR_WHOLE * whole))
    if not gaps.size:
        return plain
    law = _law(recording, loop, command)
    times, commands, ambiguous = [], [], []
    for gap in gaps:
        count = int(whole[gap]) - 1
        share = np.arange(1, count + 1) / (count + 1)
        at = time[gap] + share * (time[gap + 1] - time[gap])
        changed = recording.reference[gap + 1] != recording.reference[gap]
        if law is None:
            sent = np.full(count, 0.5 * (command[gap] + command[gap + 1]))
        else:
            sent = law(gap, share)
        times.append(at)
        commands.append(sent)
        if changed or count >= HOLE:
            ambiguous.append((count, (float(at[0]), float(time[gap + 1]))))
    ambiguous.sort(key=lambda pair: -pair[0])
    most = max(1, int(MOST_UNKNOWN * time.size))
    unknown = tuple(sorted(ends for _, ends in ambiguous[:most]))
    every = np.concatenate([time, *times])
    order = np.argsort(every, kind="stable")
    values = np.concatenate([command, *commands])
    return HeldCommands(every[order], values[order], unknown, every.size - time.size)


def _law(recording: Recording, loop: ControlLoop, command: Array):  # type: ignore[no-untyped-def]
    """The command of a P controller between two rows, if the rows show that it is in charge."""
    if not isinstance(loop.controller, P):
        return None
    Kp, limit = loop.controller.Kp, math.inf if loop.limit is None else loop.limit
    reference, output = recording.reference[: command.size], recording.output[: command.size]
    computed = np.clip(Kp * (reference - output), -limit, limit)
    if float(np.std(computed - command)) > ALIKE * float(np.std(command)):
        return None

    def sent(gap: int, share: Array) -> Array:
        line = output[gap] + share * (output[gap + 1] - output[gap])
        return np.asarray(np.clip(Kp * (reference[gap] - line), -limit, limit))

    return sent


def spikes(residuals: Array) -> NDArray[np.bool_]:
    """Rows of these residuals that are outliers: far from the median of their neighbours."""
    away, robust = _from_neighbours(residuals)
    found = np.abs(away) > SPIKE * robust if robust > 0.0 else np.zeros(away.size, dtype=bool)
    if np.sum(found) > MOST_SPIKES * away.size:
        return np.zeros(away.size, dtype=bool)
    return found


def repeated(output: Array, residuals: Array) -> NDArray[np.bool_]:
    """Rows that repeat the output of the row before while the fitted output moves on.

    Links repeat the last sample when none arrived. The controller acts on such a row, but it says
    nothing new of the output.
    """
    _, robust = _from_neighbours(residuals)
    moved = np.abs(np.diff(output - residuals))
    return np.r_[False, (np.diff(output) == 0.0) & (moved > STALE * robust)]


def _from_neighbours(residuals: Array) -> tuple[Array, float]:
    """Difference from the median of the rows around, and its robust deviation."""
    padded = np.pad(residuals, HALF_WINDOW, mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * HALF_WINDOW + 1)
    away = np.asarray(residuals - np.median(around, axis=1))
    robust = float(np.median(np.abs(away[away != 0.0]))) / MAD if np.any(away) else 0.0
    return away, max(robust, LEAST_ROBUST * float(np.std(away)))


def is_outlier(whitened: Array, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows whose whitened residual, in robust deviations, is beyond `SPIKE`."""
    sizes = np.abs(whitened[used])
    robust = max(float(np.median(sizes)) / MAD, LEAST_ROBUST)
    found = used & (np.abs(whitened) > SPIKE * robust)
    if np.sum(~used) + np.sum(found) > MOST_SPIKES * used.size:
        return np.zeros(used.size, dtype=bool)
    # The rows after an outlier are predicted from it: only the first of a run is one.
    return found & ~np.r_[False, found[:-1]]
