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

from deadtime.estimation.models._held import Path, path_of
from deadtime.loops import ControlLoop, P
from deadtime.recordings import Recording

Array = NDArray[np.float64]

#: Rows are that many samples apart, give or take this share of a sample.
NEAR_WHOLE = 0.25

#: Missing samples in a row from which their mean command is unknown.
HOLE = 3

#: Commands with times of their own: fewest that show how they were logged, the share of steps that
#: are alike where that was regular, the share of changes where each was logged, and the share of
#: the rows at the end in which lost ones may have no effect yet.
FEWEST, REGULAR, MOVES, END = 16, 0.8, 0.5, 0.2

#: Error of the output that is predicted in such a hole, in deviations of the white noise.
SHARED = 2.0

#: Lengths in rows over which neighbours are averaged, and the farthest neighbour.
LENGTHS, REACH = (0.3, 0.7, 1.5, 3.0, 6.0, 12.0, 24.0), 48

#: Most unknown commands, as a share of the rows; the longest gaps come first.
MOST_UNKNOWN = 0.1

#: A command is the controller's where the two differ by less than this share of its deviation.
ALIKE = 0.2

#: Change of the commands, as a share of their range, at which that has settled.
SETTLED = 1e-5

#: Rounds of predicting the output of a plant and computing the commands from it.
ROUNDS = 6


class HeldCommands(NamedTuple):
    """Commands that hold from their times on.

    Attributes
    ----------
    time, command : ndarray, shape (m,)
    unknown : tuple of (float, float)
        Times between which the mean command is unknown.
    computed : tuple of (float, float, float)
        Times between which a command was computed from an output, and its change by a unit of the
        error of that output; zero at its limit.
    steps : int
        In how many ways the reference may have changed between rows.
    longest : int
        Most samples in a row that are missing.
    """

    time: Array
    command: Array
    unknown: tuple[tuple[float, float], ...] = ()
    computed: tuple[tuple[float, float, float], ...] = ()
    steps: int = 1
    longest: int = 0


#: The output of the plant at some times, for a better guess than a straight line between rows.
Predicted: TypeAlias = Callable[[Array], Array]


def with_lost(time: Array, command: Array, rows: Array) -> HeldCommands:
    """Commands with times of their own, without holding one where the next ones were lost.

    Commands that were logged regularly, each time they were computed, leave a gap where some were
    lost. After a usual step the mean of those around it is taken; where many were lost, it is an
    unknown. Near the end of the rows it has no effect yet.
    """
    plain = HeldCommands(time, command)
    steps = np.diff(time)
    if steps.size < FEWEST:
        return plain
    usual = float(np.median(steps))
    regular = np.mean(np.abs(steps - usual) < NEAR_WHOLE * usual) > REGULAR
    if not regular or np.mean(np.diff(command) != 0.0) <= MOVES:
        return plain
    gaps = np.flatnonzero(steps > 1.5 * usual)
    every = np.concatenate([time, time[gaps] + usual])
    values = np.concatenate([command, 0.5 * (command[gaps] + command[gaps + 1])])
    order = np.argsort(every, kind="stable")
    last = rows[-1] - END * (rows[-1] - rows[0])
    many = gaps[(steps[gaps] > HOLE * usual) & (time[gaps] >= rows[0]) & (time[gaps + 1] <= last)]
    many = many[np.argsort(-steps[many], kind="stable")][: int(MOST_UNKNOWN * rows.size)]
    unknown = [(float(time[k] + usual), float(time[k + 1])) for k in np.sort(many)]
    return HeldCommands(every[order], values[order], tuple(unknown))


def with_missing(
    recording: Recording,
    loop: ControlLoop,
    command: Array,
    predicted: Predicted | None = None,
    step: int | None = None,
    shared: float | None = None,
    closed: bool = False,
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
    shared : float, optional
        Error of the predicted output that many missing rows share, in deviations of the white
        noise. If not given, their mean command is unknown besides.
    closed : bool
        Whether the loop answers the errors of the outputs across many missing rows.
    """
    time = recording.time[: command.size]
    plain = HeldCommands(time, command)
    if loop.sample_time is None or time.size < 2:
        return plain
    apart = np.diff(time) / loop.sample_time
    whole = np.rint(apart)
    # A row that is late, not lost, is as much closer to the next one.
    late = apart + np.append(apart[1:], np.inf) < whole + 0.5
    gaps = np.flatnonzero((whole > 1.0) & ~late & (np.abs(apart - whole) < NEAR_WHOLE * whole))
    if not gaps.size:
        return plain
    law = _law(recording, loop, command)
    commands, ambiguous, steps = [], [], 1
    computed: list[tuple[float, float, float]] = []
    counts = whole[gaps].astype(int) - 1
    shares = [np.arange(1, count + 1) / (count + 1) for count in counts]
    places = [
        time[gap] + share * (time[gap + 1] - time[gap])
        for gap, share in zip(gaps, shares, strict=True)
    ]
    outputs = np.interp(np.concatenate(places), time, recording.output[: time.size])
    if predicted is not None:
        outputs = predicted(np.concatenate(places))
    between = np.split(outputs, np.cumsum(counts)[:-1])
    error = SHARED if shared is None else shared
    for gap, at, output in zip(gaps, places, between, strict=True):
        count = at.size
        before, after = recording.reference[gap], recording.reference[gap + 1]
        ends = (float(at[0]), float(time[gap + 1]))
        known = law is not None and (before == after or step is not None)
        if law is None:
            sent = np.full(count, 0.5 * (command[gap] + command[gap + 1]))
        else:
            reference = np.where(np.arange(count) < (step or 0), before, after)
            sent = law(reference, output)
            if before != after:
                steps = max(steps, count + 1)
        commands.append(sent)
        until = np.append(at[1:], time[gap + 1])
        slopes = _slopes(loop, sent)
        shared_by_all = float(slopes.max())
        if count >= HOLE and closed:
            slopes, shared_by_all = _closed(loop, slopes)
        computed += zip(at.tolist(), until.tolist(), slopes.tolist(), strict=True)
        if count >= HOLE:
            # The output that is predicted has errors too, which all these commands share.
            free = at[slopes > 0.0]
            if free.size:
                computed.append((float(free[0]), ends[1], error * shared_by_all))
        if not known or (count >= HOLE and shared is None):
            ambiguous.append((count, ends))
    ambiguous.sort(key=lambda pair: -pair[0])
    most = max(1, int(MOST_UNKNOWN * time.size))
    unknown = tuple(sorted(ends for _, ends in ambiguous[:most]))
    every = np.concatenate([time, *places])
    order = np.argsort(every, kind="stable")
    values = np.concatenate([command, *commands])
    return HeldCommands(
        every[order], values[order], unknown, tuple(computed), steps, int(counts.max())
    )


def _slopes(loop: ControlLoop, sent: Array) -> Array:
    """Change of computed commands by a unit of the output: none at the limit."""
    gain = abs(loop.controller.gains.get("Kp", 0.0))
    limit = math.inf if loop.limit is None else loop.limit
    return np.where(np.abs(sent) < limit, gain, 0.0)


def _closed(loop: ControlLoop, slopes: Array) -> tuple[Array, float]:
    """Change of the sum of the commands by an error of each output they are computed from.

    The loop answers an error: with the response M of the outputs to the commands and their slopes
    K, the commands change by (I + K M)^-1 K e. The second number is the mean change of a command
    by an error that all outputs share.
    """
    from scipy import linalg

    known = {"gain": 1.0, **loop.parameters}
    sample_time = loop.sample_time or 1.0
    pulse = path_of(loop.plant, np.array([0.0, sample_time]), np.array([1.0, 0.0]))
    ages = np.asarray(sample_time * np.arange(slopes.size) - known["delay"], dtype=np.float64)
    response = known["gain"] * pulse.value(ages, known)
    M = linalg.toeplitz(response, np.zeros(slopes.size))
    change = np.linalg.solve(np.eye(slopes.size) + slopes[:, None] * M, np.diag(slopes))
    sums = change.sum(axis=0)
    return np.abs(sums), abs(float(sums.sum())) / max(1, int(np.count_nonzero(slopes)))


def smoothed(values: Array) -> tuple[Array, float]:
    """Weighted means of neighbours, and their deviation by white noise of one.

    They are over the length that predicts each value best from the rest.
    """
    best, least, error_of_best = values, math.inf, 1.0
    offsets = np.arange(-REACH, REACH + 1)
    inside = np.ones(values.size)
    for length in LENGTHS:
        weights = np.exp(-np.abs(offsets) / length)
        weights[REACH] = 0.0
        sums = np.convolve(values, weights, mode="same")[: values.size]
        shares = np.convolve(inside, weights, mode="same")[: values.size]
        error = float(np.median(np.abs(values - sums / shares)))
        if error < least:
            least, best = error, (sums + values) / (shares + 1.0)
            # At an end, as beside a hole, there are neighbours on one side.
            half = weights[REACH + 1 :]
            error_of_best = math.sqrt(1.0 + half @ half) / (1.0 + float(half.sum()))
    return np.asarray(best), error_of_best


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
    recording: Recording,
    loop: ControlLoop,
    command: Array,
    first: HeldCommands,
    step: int | None,
    unsure: bool = True,
    calm: bool = False,
) -> HeldCommands:
    """Commands between rows from the output that `loop` predicts there, starting from `first`.

    What moves the output beside the commands is interpolated between rows. Where it is `calm`, none
    does, and across many missing rows the loop is predicted from those before.
    """
    commands = first
    known = {"gain": 1.0, **loop.parameters}
    rows = slice(0, command.size)
    time, output = recording.time[rows], recording.output[rows]
    apart = np.diff(time) / (loop.sample_time or math.inf)
    holes = np.flatnonzero(calm & (apart > HOLE + 0.5))
    for _ in range(ROUNDS + calm * first.longest):
        path = path_of(loop.plant, commands.time, commands.command)

        def modelled(times: Array, path: Path = path) -> Array:
            return np.asarray(known["gain"] * path.value(times - known["delay"], known))

        beside = output - modelled(time)
        left, error = smoothed(beside)
        held = left.copy()
        if holes.size:
            pieces = np.split(beside, holes + 1)[:-1]
            held[holes] = [one.mean() for one in pieces]
            error = max(1.0 / math.sqrt(one.size) for one in pieces)

        def predicted(
            times: Array, left: Array = left, held: Array = held, modelled: Predicted = modelled
        ) -> Array:
            before = np.searchsorted(time, times, side="right") - 1
            across = np.isin(before, holes)
            return modelled(times) + np.where(across, held[before], np.interp(times, time, left))

        again = with_missing(
            recording, loop, command, predicted, step, None if unsure else error, calm
        )
        moved = float(np.max(np.abs(again.command - commands.command)))
        commands = again
        if moved <= SETTLED * float(np.ptp(command)):
            break
    return commands
