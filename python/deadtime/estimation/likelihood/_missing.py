"""Commands between rows that are further apart than the samples of the controller.

A sampled controller sends a command at each of its samples, logged or not. Where rows are further
apart than its samples, the commands between them are those of the controller, computed from the
reference and a straight line between the outputs, if that controller is known and its law holds
on the rows; else the mean of the commands before and after. Where the reference changes between
two such rows, or many rows are missing, the mean command between them is an unknown of a first fit.
With its plant, the output in between is predicted, and the commands are computed from that; each
time at which the reference may have changed is tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime.estimation.models._held import path_of
from deadtime.loops import ControlLoop, P
from deadtime.recordings import Recording

Array = NDArray[np.float64]

#: Rows are that many samples apart, give or take this share of a sample.
NEAR_WHOLE = 0.25

#: Missing samples in a row from which their mean command is unknown.
HOLE = 3

#: Most unknown commands, as a share of the rows; the longest gaps come first.
MOST_UNKNOWN = 0.1

#: A command is the controller's where the two differ by less than this share of its deviation.
ALIKE = 0.2

#: Change of the commands, as a share of their range, at which that has settled.
SETTLED = 1e-6

#: Rounds of predicting the output of a plant and computing the commands from it.
ROUNDS = 6


class HeldCommands(NamedTuple):
    """Commands that hold from their times on.

    Attributes
    ----------
    time, command : ndarray, shape (m,)
    unknown : tuple of (float, float)
        Times between which the mean command is unknown.
    filled : int
        Commands that were not in the log.
    steps : int
        In how many ways the reference may have changed between rows.
    """

    time: Array
    command: Array
    unknown: tuple[tuple[float, float], ...] = ()
    filled: int = 0
    steps: int = 1


#: The output of the plant at some times, for a better guess than a straight line between rows.
Predicted: TypeAlias = Callable[[Array], Array]


def with_missing(
    recording: Recording,
    loop: ControlLoop,
    command: Array,
    predicted: Predicted | None = None,
    step: int | None = None,
) -> HeldCommands:
    """The commands of all samples of the controller, from those of the first rows.

    Parameters
    ----------
    recording, loop
    command : ndarray, shape (m,)
        Commands of the first rows.
    predicted : callable, optional
        The output between rows; a straight line by default.
    step : int, optional
        After how many missing samples the reference changes, where it changes between rows that
        are further apart than samples. If not given, the mean command there is unknown.
    """
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
    times, commands, ambiguous, steps = [], [], [], 1
    for gap in gaps:
        count = int(whole[gap]) - 1
        share = np.arange(1, count + 1) / (count + 1)
        at = time[gap] + share * (time[gap + 1] - time[gap])
        before, after = recording.reference[gap], recording.reference[gap + 1]
        ends = (float(at[0]), float(time[gap + 1]))
        known = law is not None and (before == after or step is not None)
        if law is None:
            sent = np.full(count, 0.5 * (command[gap] + command[gap + 1]))
        else:
            reference = np.where(np.arange(count) < (step or 0), before, after)
            outputs = recording.output[gap : gap + 2]
            line = outputs[0] + share * (outputs[1] - outputs[0])
            if predicted is not None:
                middle, both = predicted(at), predicted(time[gap : gap + 2])
                line = line + middle - (both[0] + share * (both[1] - both[0]))
            sent = law(reference, line)
            if before != after:
                steps = max(steps, count + 1)
        times.append(at)
        commands.append(sent)
        if not known or (count >= HOLE and predicted is None):
            ambiguous.append((count, ends))
    ambiguous.sort(key=lambda pair: -pair[0])
    most = max(1, int(MOST_UNKNOWN * time.size))
    unknown = tuple(sorted(ends for _, ends in ambiguous[:most]))
    every = np.concatenate([time, *times])
    order = np.argsort(every, kind="stable")
    values = np.concatenate([command, *commands])
    return HeldCommands(every[order], values[order], unknown, every.size - time.size, steps)


def _law(
    recording: Recording, loop: ControlLoop, command: Array
) -> Callable[[Array, Array], Array] | None:
    """The command of a P controller, if the rows show that it is in charge."""
    if not isinstance(loop.controller, P):
        return None
    Kp, limit = loop.controller.Kp, math.inf if loop.limit is None else loop.limit

    def law(reference: Array, output: Array) -> Array:
        return np.asarray(np.clip(Kp * (reference - output), -limit, limit))

    computed = law(recording.reference[: command.size], recording.output[: command.size])
    differs = float(np.std(computed - command)) > ALIKE * float(np.std(command))
    return None if differs else law


def predicted_commands(
    recording: Recording, loop: ControlLoop, command: Array, first: HeldCommands, step: int | None
) -> HeldCommands:
    """Commands between rows from the output that `loop` predicts there, starting from `first`."""
    commands, values = first, loop.parameters
    for _ in range(ROUNDS):
        path = path_of(loop.plant, commands.time, commands.command)

        def predicted(times: Array) -> Array:
            known = {"gain": 1.0, **values}
            return np.asarray(known["gain"] * path.value(times - known["delay"], known))  # noqa: B023

        again = with_missing(recording, loop, command, predicted, step)
        moved = float(np.max(np.abs(again.command - commands.command)))
        commands = again
        if moved <= SETTLED * float(np.ptp(command)):
            break
    return commands
