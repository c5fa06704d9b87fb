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
from dataclasses import dataclass
from functools import cached_property, lru_cache
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array, Indices
from deadtime.estimation.models._held import path_of
from deadtime.loops import ControlLoop, P
from deadtime.recordings import Recording

#: Rows are that many samples apart, give or take this share of a sample.
NEAR_WHOLE = 0.25

#: Missing samples in a row from which their mean command is unknown.
HOLE = 3

#: Commands with times of their own: fewest that show how they were logged, the share of steps that
#: are alike where that was regular, the share of changes where each was logged, and the share of
#: the rows at the end in which lost ones may have no effect yet.
FEWEST, REGULAR, MOVES, END = 16, 0.6, 0.5, 0.2

#: Change of the command across a gap, as a share of the range of all and over the usual change,
#: from which the mean of those around it says too little of the lost ones.
STEP, UNUSUAL = 0.05, 3.0

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
        error of that output, zero at its limit; in the order of the later times.
    steps : int
        In how many ways the reference may have changed between rows.
    longest : int
        Most samples in a row that are missing.
    lost : int
        Gaps in the log of commands with times of their own, in which some are taken for lost.
    """

    time: Array
    command: Array
    unknown: tuple[tuple[float, float], ...] = ()
    computed: tuple[tuple[float, float, float], ...] = ()
    steps: int = 1
    longest: int = 0
    lost: int = 0


def with_lost(time: Array, command: Array, rows: Array) -> HeldCommands:
    """Commands with times of their own, without holding one where the next ones were lost.

    Commands that were logged regularly, each time they were computed, leave a gap where some were
    lost. After a usual step the mean of those around it is taken; where many were lost, or the
    command changes much, it is an unknown. Near the end of the rows it has no effect yet.
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
    if gaps.size == 0:
        return plain
    every = np.concatenate([time, time[gaps] + usual])
    values = np.concatenate([command, 0.5 * (command[gaps] + command[gaps + 1])])
    order = np.argsort(every, kind="stable")
    last = rows[-1] - END * (rows[-1] - rows[0])
    change = np.abs(np.diff(command))
    jumps = change > max(STEP * float(np.ptp(command)), UNUSUAL * float(np.median(change)))
    doubtful = gaps[(steps[gaps] > HOLE * usual) | jumps[gaps]]
    kept = doubtful[(time[doubtful] >= rows[0]) & (time[doubtful + 1] <= last)]
    kept = kept[np.argsort(-steps[kept], kind="stable")][: int(MOST_UNKNOWN * rows.size)]
    unknown = [(float(time[k] + usual), float(time[k + 1])) for k in np.sort(kept)]
    return HeldCommands(every[order], values[order], tuple(unknown), lost=gaps.size)


def with_missing(
    recording: Recording, loop: ControlLoop, command: Array, step: int | None = None
) -> HeldCommands:
    """The commands of all samples of the controller, from those of the first rows.

    Parameters
    ----------
    recording, loop
    command : ndarray, shape (m,)
        Commands of the first rows.
    step : int, optional
        After how many missing samples the reference changes, where it changes between rows that
        are further apart than samples. If not given, the mean command there is unknown.
    """
    gaps = _Gaps.of(recording, loop, command)
    if gaps is None:
        return HeldCommands(recording.time[: command.size], command)
    outputs = np.interp(gaps.places, gaps.time, recording.output[: command.size])
    return _Missing(recording, loop, command, gaps, step).filled(outputs)


class _Gaps(NamedTuple):
    """Rows that are further apart than the samples of a controller, and the samples between."""

    time: Array
    #: The row before each gap, how many samples are missing in it, and the row after, s.
    rows: Indices
    counts: Indices
    ends: Array
    #: Where the samples of each gap begin among all missing ones, and where the last of them end.
    firsts: Indices
    #: Of each missing sample: its time, that of the next one, s, and its number in its gap.
    places: Array
    until: Array
    number: Indices
    #: Times of the rows and then of the missing samples, put in order.
    order: Indices

    @staticmethod
    def of(recording: Recording, loop: ControlLoop, command: Array) -> _Gaps | None:
        """Those between the first rows, as many as commands; None where there is none."""
        time = recording.time[: command.size]
        if loop.sample_time is None or time.size < 2:
            return None
        apart = np.diff(time) / loop.sample_time
        whole = np.rint(apart)
        # A row that is late, not lost, is as much closer to the next one.
        late = apart + np.append(apart[1:], np.inf) < whole + 0.5
        rows = np.flatnonzero((whole > 1.0) & ~late & (np.abs(apart - whole) < NEAR_WHOLE * whole))
        if not rows.size:
            return None
        counts = whole[rows].astype(np.intp) - 1
        firsts = np.append(0, np.cumsum(counts))
        number = np.arange(firsts[-1]) - np.repeat(firsts[:-1], counts)
        ends = time[rows + 1]
        share = (number + 1) / np.repeat(counts + 1, counts)
        places = np.repeat(time[rows], counts) + share * np.repeat(ends - time[rows], counts)
        until = np.append(places[1:], np.nan)
        until[firsts[1:] - 1] = ends
        order = np.argsort(np.append(time, places), kind="stable")
        return _Gaps(time, rows, counts, ends, firsts, places, until, number, order)

    def each(self, values: Array) -> Array:
        """Values of gaps as those of their samples."""
        return np.repeat(values, self.counts)


@dataclass(frozen=True, eq=False)
class _Missing:
    """What is known of the commands between rows, whatever the output there; see `with_missing`."""

    recording: Recording
    loop: ControlLoop
    command: Array
    gaps: _Gaps
    step: int | None

    @cached_property
    def law(self) -> Callable[[Array, Array], Array] | None:
        """The command of a P controller, if the rows show that it is in charge."""
        controller, limit = self.loop.controller, self.loop.limit or math.inf
        if not isinstance(controller, P):
            return None

        def law(reference: Array, output: Array) -> Array:
            return np.asarray(np.clip(controller.Kp * (reference - output), -limit, limit))

        rows = slice(0, self.command.size)
        differs = law(self.recording.reference[rows], self.recording.output[rows]) - self.command
        return None if np.std(differs) > ALIKE * np.std(self.command) else law

    @cached_property
    def response(self) -> Array:
        """See `_response`; for as many samples as are missing in a row."""
        return _response(self.loop, int(self.gaps.counts.max()))

    def filled(
        self, outputs: Array, shared: float | None = None, closed: bool = False
    ) -> HeldCommands:
        """The commands for outputs at the missing samples.

        `shared` is the error of the output that many missing rows share, in deviations of the white
        noise; if None, their mean command is unknown besides. `closed`: the loop answers errors of
        the outputs across many missing rows.
        """
        gaps, command, reference = self.gaps, self.command, self.recording.reference
        before, after = reference[gaps.rows], reference[gaps.rows + 1]
        changes = before != after
        steps = 1
        if self.law is None:
            sent = gaps.each(0.5 * (command[gaps.rows] + command[gaps.rows + 1]))
            unknown = np.full(changes.shape, True)
        else:
            is_before = gaps.number < (self.step or 0)
            sent = self.law(np.where(is_before, gaps.each(before), gaps.each(after)), outputs)
            steps += int(gaps.counts.max(initial=0, where=changes))
            unknown = changes & (self.step is None)
        many = np.flatnonzero(gaps.counts >= HOLE)
        slopes = self._slopes(sent)
        together = []
        for gap in many:
            # The output that is predicted has errors too, which all these commands share.
            inside = slice(*gaps.firsts[gap : gap + 2])
            shared_by_all = float(slopes[inside].max())
            if closed:
                slopes[inside], shared_by_all = _closed(slopes[inside], self.response)
            free = gaps.places[inside][slopes[inside] > 0.0]
            if free.size:
                error = SHARED if shared is None else shared
                together.append((float(free[0]), float(gaps.ends[gap]), error * shared_by_all))
        if shared is None:
            unknown[many] = True
        computed = zip(gaps.places.tolist(), gaps.until.tolist(), slopes.tolist(), strict=True)
        ambiguous = np.flatnonzero(unknown)
        ambiguous = ambiguous[np.argsort(-gaps.counts[ambiguous], kind="stable")]
        ambiguous = np.sort(ambiguous[: max(1, int(MOST_UNKNOWN * gaps.time.size))])
        begins = gaps.places[gaps.firsts[ambiguous]]
        return HeldCommands(
            np.append(gaps.time, gaps.places)[gaps.order],
            np.append(command, sent)[gaps.order],
            tuple(zip(begins.tolist(), gaps.ends[ambiguous].tolist(), strict=True)),
            tuple(sorted((*computed, *together), key=itemgetter(1))),
            steps,
            int(gaps.counts.max()),
        )

    def _slopes(self, sent: Array) -> Array:
        """Change of computed commands by a unit of the output: none at the limit."""
        gain = abs(self.loop.controller.gains.get("Kp", 0.0))
        return np.where(np.abs(sent) < (self.loop.limit or math.inf), gain, 0.0)


def _response(loop: ControlLoop, samples: int) -> Array:
    """Of the output to a command that lasts a sample, after whole samples since its start."""
    known = {"gain": 1.0, **loop.parameters}
    sample_time = loop.sample_time or 1.0
    pulse = path_of(loop.plant, np.array([0.0, sample_time]), np.array([1.0, 0.0]))
    ages = np.asarray(sample_time * np.arange(samples) - known["delay"], dtype=np.float64)
    return np.asarray(known["gain"] * pulse.value(ages, known))


def _closed(slopes: Array, response: Array) -> tuple[Array, float]:
    """Change of the sum of the commands by an error of each output they are computed from.

    The loop answers an error: with the response M of the outputs to the commands and their slopes
    K, the commands change by (I + K M)^-1 K e. The second number is the mean change of a command
    by an error that all outputs share.
    """
    from scipy import linalg

    M = linalg.toeplitz(response[: slopes.size], np.zeros(slopes.size))
    change = np.linalg.solve(np.eye(slopes.size) + slopes[:, None] * M, np.diag(slopes))
    sums = change.sum(axis=0)
    return np.abs(sums), abs(float(sums.sum())) / max(1, int(np.count_nonzero(slopes)))


@lru_cache(maxsize=8)
def _neighbours(size: int) -> tuple[Array, Array]:
    """Weights of neighbours for each of `LENGTHS`, and their sums for each of so many values."""
    from scipy import ndimage

    weights = np.exp(-np.abs(np.arange(-REACH, REACH + 1)) / np.array(LENGTHS)[:, None])
    weights[:, REACH] = 0.0
    shares = [ndimage.correlate1d(np.ones(size), one, mode="constant") for one in weights]
    return weights, np.array(shares)


def smoothed(values: Array) -> tuple[Array, float]:
    """Weighted means of neighbours, and their deviation by white noise of one.

    They are over the length that predicts each value best from the rest.
    """
    from scipy import ndimage

    weights, shares = _neighbours(values.size)
    sums = np.array([ndimage.correlate1d(values, one, mode="constant") for one in weights])
    best = int(np.argmin(np.median(np.abs(values - sums / shares), axis=1)))
    # At an end, as beside a hole, there are neighbours on one side.
    half = weights[best, REACH + 1 :]
    error = math.sqrt(1.0 + half @ half) / (1.0 + float(half.sum()))
    return (sums[best] + values) / (shares[best] + 1.0), error


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
    gaps = _Gaps.of(recording, loop, command)
    if gaps is None:
        return first
    missing = _Missing(recording, loop, command, gaps, step)
    known = {"gain": 1.0, **loop.parameters}
    time, output = gaps.time, recording.output[: command.size]
    apart = np.diff(time) / (loop.sample_time or math.inf)
    holes = np.flatnonzero(calm & (apart > HOLE + 0.5))
    row = np.searchsorted(time, gaps.places, side="right") - 1
    across = np.isin(row, holes)
    commands = first
    for _ in range(ROUNDS + calm * first.longest):
        path = path_of(loop.plant, commands.time, commands.command)
        modelled, there = (
            known["gain"] * path.value(times - known["delay"], known)
            for times in (time, gaps.places)
        )
        beside = output - modelled
        left, error = smoothed(beside)
        held = left.copy()
        if holes.size:
            pieces = np.split(beside, holes + 1)[:-1]
            held[holes] = [one.mean() for one in pieces]
            error = max(1.0 / math.sqrt(one.size) for one in pieces)
        there += np.where(across, held[row], np.interp(gaps.places, time, left))
        again = missing.filled(there, None if unsure else error, calm)
        moved = float(np.max(np.abs(again.command - commands.command)))
        commands = again
        if moved <= SETTLED * float(np.ptp(command)):
            break
    return commands
