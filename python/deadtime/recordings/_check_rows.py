"""The rows of a recording: the time between them, rows that are missing, and rows that repeat."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime.loops import ControlLoop
from deadtime.recordings._findings import Columns, Finding, seconds

#: Largest deviation of a time between rows, as a share of it, that is rounding of the stamps.
NOMINAL = 1e-4

#: Largest standard deviation of the time between rows, as a share of it, of even stamps.
EVEN = 0.01

#: Jitter, as a share of the time between rows, above which it is a warning.
MUCH_JITTER = 0.05

#: A row that comes later by no more than so many standard deviations is not missed.
LATE = 5.0

#: Missing rows from which a gap counts as a hole, not as lost rows.
HOLE = 5

#: A change over a gap, as a share of the range of the signal, that has little effect.
UNCHANGED = 0.02

#: Rows repeat where the output moves by more than so many of its smallest changes before and after;
#: with the larger number, rounding gives hardly any.
MOVES = (2.5, 5.5)

#: Longest run of repeated rows; longer ones are an output at rest.
LONGEST_REPEAT = 4

#: Standard deviations by which repeated rows exceed the number that rounding gives.
BY_CHANCE = 2.5

#: Share of repeated rows above which they are a warning.
MANY_REPEATS = 0.02


class Hole(NamedTuple):
    """A gap in a recording.

    Attributes
    ----------
    before, after : int
        The rows around it.
    missing : int
        Number of rows that are missing between them.
    """

    before: int
    after: int
    missing: int


class Rows(NamedTuple):
    """How the rows of a recording lie in time.

    `row_time` is the time between neighbouring rows, s, and `mean_time` its mean where none is
    missing; `adjacent` tells for each two neighbours that no row is missing between them.
    """

    row_time: float
    mean_time: float
    jitter: float
    stamps: Literal["nominal", "even", "jittered"]
    adjacent: NDArray[np.bool_]
    holes: tuple[Hole, ...]
    repeated: NDArray[np.intp]
    repeated_share: float


def read_rows(columns: Columns) -> Rows:
    """Measure how the rows lie in time."""
    spacing = np.diff(columns.time)
    # The median of those that are not much longer than the shorter ones: rows may be missing.
    shorter = float(np.quantile(spacing, 0.25))
    row_time = float(np.median(spacing[spacing < 1.5 * shorter]))
    steps = np.maximum(1.0, np.rint(spacing / row_time))
    usual = float(np.median(np.abs(spacing - steps * row_time))) / 0.6745
    gap = (steps > 1.0) & (spacing > row_time + LATE * usual)
    adjacent = ~gap
    error = spacing[adjacent] - row_time
    jitter = float(np.std(error))
    rounding = max(NOMINAL * row_time, 4.0 * float(np.spacing(np.max(np.abs(columns.time)))))
    stamps: Literal["nominal", "even", "jittered"] = "jittered"
    if float(np.max(np.abs(error))) <= rounding:
        stamps = "nominal"
    elif jitter <= EVEN * row_time:
        stamps = "even"
    gaps = np.flatnonzero(gap)
    missing = steps[gaps].astype(int) - 1
    holes = tuple(
        Hole(row, row + 1, number)
        for row, number in zip(gaps.tolist(), missing.tolist(), strict=True)
    )
    repeated, share = _repeated(columns)
    mean_time = float(np.mean(spacing[adjacent]))
    return Rows(row_time, mean_time, jitter, stamps, adjacent, holes, repeated, share)


def repeated_rows(columns: Columns) -> NDArray[np.intp]:
    """Rows that repeat the one before while the output moves."""
    return _repeated(columns)[0]


def _repeated(columns: Columns) -> tuple[NDArray[np.intp], float]:
    """Rows that repeat the one before while the output moves, and their share of moving rows."""
    none = np.empty(0, dtype=np.intp)
    change = np.diff(columns.output)
    moved = np.abs(change)
    if not moved.any():
        return none, 0.0
    same = moved == 0.0
    for signal in (columns.reference, columns.command):
        if signal is not None:
            same &= signal[1:] == signal[:-1]
    # Entry k is the change from row k to row k + 1; a run is of changes that are none.
    step = float(moved[moved > 0.0].min())
    edges = np.diff(np.concatenate([[False], same, [False]]).astype(np.int8))
    begin, end = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    inner = (begin > 0) & (end < same.size) & (end - begin <= LONGEST_REPEAT)
    begin, end = begin[inner], end[inner]
    moving = np.minimum(moved[begin - 1], moved[np.minimum(end, same.size - 1)]) > MOVES[0] * step
    begin, end = begin[moving], end[moving]
    single = 1 + np.flatnonzero((moved[1:-1] > 0.0) & (moved[1:-1] < 1.5 * step))
    single = single[np.minimum(moved[single - 1], moved[single + 1]) > MOVES[0] * step]
    if not _beyond_chance(change / step, begin, end, single):
        return none, 0.0
    length = end - begin
    within = np.arange(int(length.sum())) - np.repeat(np.cumsum(length) - length, length)
    rows = np.repeat(begin, length) + within + 1
    moving_rows = rows.size + np.count_nonzero(moved > MOVES[0] * step)
    return rows, max(0.0, rows.size - 0.5 * single.size) / moving_rows


def _beyond_chance(
    change: NDArray[np.float64],
    begin: NDArray[np.intp],
    end: NDArray[np.intp],
    single: NDArray[np.intp],
) -> bool:
    """Whether runs of no change are more than rounding gives a noisy output.

    Such an output changes by nothing less often than by one step up or down, and after that it
    mostly turns back, while one that was read twice goes on.
    """
    for least in MOVES:
        counts = []
        for first, last in ((begin, end), (single, single + 1)):
            before, after = change[first - 1], change[last]
            fast = np.minimum(np.abs(before), np.abs(after)) > least
            counts.append((np.count_nonzero(fast), np.count_nonzero(fast & (before * after > 0.0))))
        for seen, chance in zip(*counts, strict=True):
            if seen > chance + BY_CHANCE * np.sqrt(chance + 1.0):
                return True
    return False


def row_findings(columns: Columns, rows: Rows, loop: ControlLoop) -> Iterator[Finding]:
    """What the times of the rows, missing ones and repeated ones do to an estimate."""
    yield from _stamp_findings(columns, rows)
    lost = [hole for hole in rows.holes if hole.missing < HOLE]
    if lost:
        number = sum(hole.missing for hole in lost)
        share = 100.0 * number / (columns.time.size + number)
        what = f"{number} {'row is' if number == 1 else 'rows are'} missing ({share:.2g} %)"
        yield _gap_finding("rows_lost", what, lost, columns, loop)
    holes = [hole for hole in rows.holes if hole.missing >= HOLE]
    if holes:
        longest = max(holes, key=lambda hole: hole.missing)
        length = float(columns.time[longest.after] - columns.time[longest.before])
        what = (
            f"the rows have {len(holes)} {'hole' if len(holes) == 1 else 'holes'}. The longest "
            f"is {seconds(length)} ({longest.missing} rows), after "
            f"{columns.time[longest.before]:g} s"
        )
        yield _gap_finding("hole", what, holes, columns, loop)
    if rows.repeated.size:
        share = rows.repeated_share
        yield Finding(
            "rows_repeated",
            "warning" if share > MANY_REPEATS else "note",
            f"{rows.repeated.size} rows repeat the previous row while the output moves "
            f"({100.0 * share:.2g} % of the moving rows), so they contain no new measurement. "
            "Leave these rows out, or log each measurement when it arrives",
            f"on average the output is {seconds(share * rows.row_time, 3)} older than the time "
            "of its row, which adds to the delay",
            share * rows.row_time,
        )


def _stamp_findings(columns: Columns, rows: Rows) -> Iterator[Finding]:
    if rows.stamps == "nominal":
        yield Finding(
            "stamps_nominal",
            "note",
            f"the time stamps are exactly {seconds(rows.row_time)} apart, but measured times "
            "rarely are",
            "if the time stamps are planned times and not measured, jitter cannot be seen",
        )
    elif rows.stamps == "jittered":
        rate = float(np.quantile(np.abs(np.diff(columns.output)) / np.diff(columns.time), 0.95))
        yield Finding(
            "jitter",
            "warning" if rows.jitter > MUCH_JITTER * rows.row_time else "note",
            f"the time between rows is {seconds(rows.row_time)}, with a standard deviation of "
            f"{seconds(rows.jitter, 2)}",
            "a fit that assumes evenly spaced samples has an error of this size in the time of "
            f"each command. At an output speed of {rate:.2g} per second, the errors act like "
            f"noise of {rate * rows.jitter:.2g}",
        )


def _gap_finding(
    code: str, what: str, holes: list[Hole], columns: Columns, loop: ControlLoop
) -> Finding:
    """A finding about gaps: a note where the command is the same on both sides of each."""
    commands = columns.commands(loop)
    if commands is None:
        return Finding(
            code,
            "warning",
            what,
            "the command between these rows is unknown, because it is not logged elsewhere",
        )
    before = np.array([hole.before for hole in holes])
    change, moved = (np.abs(part[before + 1] - part[before]) for part in (commands, columns.output))
    length = columns.time[before + 1] - columns.time[before]
    same = change <= UNCHANGED * float(np.ptp(commands))
    same &= columns.reference[before + 1] == columns.reference[before]
    if code == "hole":  # A whole response may lie within it.
        same &= moved <= UNCHANGED * float(np.ptp(columns.output))
    if same.all():
        return Finding(
            code,
            "note",
            what,
            "the command is nearly the same before and after, so little is lost",
        )
    worst = int(np.argmax(np.where(same, -1.0, change * length)))
    return Finding(
        code,
        "warning",
        what,
        "the command in a gap is unknown. If a fit holds the last command over the gap, delay "
        f"and gain are wrong. The largest change is {float(change[worst]):.3g} over "
        f"{seconds(length[worst])}, after {columns.time[before[worst]]:g} s",
    )
