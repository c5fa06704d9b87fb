"""The clock of the rows against the sample time of the controller, and the unit of time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import ControlLoop, Integrator, P
from deadtime.recordings._check_command import Command
from deadtime.recordings._check_rows import Rows
from deadtime.recordings._findings import Columns, Finding, Severity, seconds

#: Units of time that are mistaken for seconds, by their number in a second.
UNITS = {1e3: "milliseconds", 1e6: "microseconds"}

#: A recording of more than so many samples may be that of a slow controller.
SAMPLES = 20.0

#: Largest relative difference of two clocks, and those above which it is a warning or refused.
CLOCKS, CLOCK_WARNING, CLOCK_REFUSED = 0.05, 1e-3, 5e-3

#: Share of changes of the command that may come sooner than a sample time after the last one, and
#: where each has a time of its own, as when a link that scatters has moved it.
HASTE, HASTE_SENT = 0.2, 0.5

#: A continuous loop whose rows are so many times 1/(Kp gain) apart shows no response between them,
#: and one that lasts less than this many of them has none.
COARSE, BRIEF = 20.0, 0.02

#: Sign changes of the second differences of an output, as a share, above which it holds noise from
#: sample to sample: 0.73 for white noise, next to none for a smooth curve.
ROUGH = 0.5


class Clock(NamedTuple):
    """Rows against samples: whole samples a row, ratio of the clocks, a sample time not told."""

    rate_ratio: int | None = None
    clock_ratio: float | None = None
    sample_time_seen: float | None = None


def read_clock(columns: Columns, rows: Rows, command: Command, loop: ControlLoop) -> Clock:
    """Compare the time between rows with the sample time."""
    if loop.sample_time is None:
        on_rows = command.law in ("exact", "late", "early") and rows.stamps != "jittered"
        return Clock(sample_time_seen=rows.mean_time if on_rows else None)
    if columns.sent is not None:
        return Clock()  # commands have their own times
    ratio = rows.mean_time / loop.sample_time
    whole = max(1, round(ratio))
    error = 3.0 * rows.jitter / rows.row_time / np.sqrt(columns.time.size)
    relative = ratio / whole
    if abs(relative - 1.0) > CLOCKS + error:
        return Clock()
    beyond_rounding = abs(relative - 1.0) > max(CLOCK_WARNING, error)
    return Clock(whole, relative if beyond_rounding else 1.0)


def clock_findings(
    columns: Columns, rows: Rows, command: Command, loop: ControlLoop, clock: Clock
) -> Iterator[Finding]:
    """What the clock of the rows does to an estimate."""
    if loop.sample_time is None:
        yield from _without_sample_time(columns, rows, loop, clock)
        return
    unit = _unit(columns, rows.mean_time, loop, loop.sample_time)
    if unit is not None:
        yield unit
    elif clock.rate_ratio is None or clock.clock_ratio is None:
        yield from _other_spacing(columns, rows, command, loop.sample_time)
    else:
        yield from _near_samples(rows, loop.sample_time, clock.rate_ratio, clock.clock_ratio)


def _own_time(loop: ControlLoop) -> float | None:
    """Time in which a loop without its delay follows its reference, s, if it is known."""
    if isinstance(loop.controller, P) and isinstance(loop.plant, Integrator):
        return 1.0 / abs(loop.controller.Kp * loop.plant.gain)
    return None


def _unit(
    columns: Columns, row_time: float, loop: ControlLoop, sample_time: float
) -> Finding | None:
    """A factor of 1000 or a million between rows and sample time.

    It may also be that of a slow log of a fast controller, or of a fast log of a slow one, where
    the loop is slow enough for these rows, or the recording long enough for these samples.
    """
    own = _own_time(loop)
    slow_log = own is not None and row_time < own
    slow_controller = columns.time[-1] - columns.time[0] > SAMPLES * sample_time
    words = (
        f"the rows are {row_time:g} apart in the unit of the time stamps, but sample_time is "
        f"{sample_time:g} s"
    )
    for factor, unit in UNITS.items():
        if not slow_log and 0.45 < row_time / sample_time / factor < 2.2:
            return Finding(
                "time_unit",
                "refused",
                f"{words}, a factor of {factor:.0f}. The time stamps are probably {unit}: "
                f"divide the time stamps by {factor:.0f}",
                f"delays would be {factor:.0f} times too long, and gains too small by the "
                "same factor",
            )
        if not slow_controller and 0.45 < row_time / sample_time * factor < 2.2:
            return Finding(
                "time_unit",
                "refused",
                f"{words}, a factor of {factor:.0f}. Either sample_time is in {unit}, or the "
                f"time stamps were divided by {factor:.0f} without need: give both in seconds",
                f"delays would be up to {factor:.0f} times too short",
            )
    return None


def _near_samples(rows: Rows, sample_time: float, whole: int, ratio: float) -> Iterator[Finding]:
    if ratio != 1.0:
        off = abs(ratio - 1.0)
        severity: Severity = "refused" if off > CLOCK_REFUSED else "warning"
        yield Finding(
            "two_clocks",
            severity,
            f"the rows are {seconds(rows.mean_time)} apart, {100.0 * off:.2g} % "
            f"{'more' if ratio > 1.0 else 'less'} than "
            + ("the sample_time" if whole == 1 else f"{whole} times the sample_time")
            + f" of {seconds(sample_time)}. If the time stamps are right, give "
            f"sample_time={rows.mean_time / whole:.6g}. If the controller's clock is right, "
            "scale the time stamps",
            f"with the wrong clock, gain and delay have an error of {100.0 * off:.2g} %",
            share=off,
        )
    if whole > 1:
        late = 0.5 * (whole - 1) * sample_time
        yield Finding(
            "lower_rate",
            "warning",
            f"the controller samples every {seconds(sample_time)}, but only one of {whole} "
            "samples has a row: "
            + ("every other command is" if whole == 2 else f"{whole - 1} of {whole} commands are")
            + " missing. Log at the rate of the controller",
            "if a fit holds each command until the next row, the delay is up to "
            f"{seconds(late)} too short",
        )


def _other_spacing(
    columns: Columns, rows: Rows, command: Command, sample_time: float
) -> Iterator[Finding]:
    """Rows that are neither at the samples nor at every so many of them."""
    if columns.sent is not None:
        soon = _hasty(columns.sent, sample_time)
        if soon > HASTE_SENT:
            reason = (
                f"commands have their own times, although sample_time is {seconds(sample_time)}"
            )
            yield _no_such_hold(reason, soon, sample_time)
        return
    words = (
        f"the rows are {seconds(rows.mean_time)} apart, but sample_time is {seconds(sample_time)}"
    )
    shift = f"the delay is uncertain by up to half a sample time, {seconds(0.5 * sample_time)}"
    if command.law in ("exact", "late", "early"):
        yield Finding(
            "sample_time",
            "refused",
            f"{words}, but the command changes on each row: give sample_time={rows.mean_time:.6g}",
            "a wrong hold changes the estimated delay by half the difference, "
            f"{seconds(0.5 * abs(rows.mean_time - sample_time))}",
        )
    elif rows.mean_time > sample_time:
        yield Finding(
            "other_rate",
            "warning",
            f"{words}. So the rows are not the samples of the controller, and commands between "
            "rows are missing. Log at the rate of the controller",
            f"{shift} and by half a row, {seconds(0.5 * rows.mean_time)}",
            0.5 * (sample_time + rows.mean_time),
        )
    elif columns.command is None:
        yield Finding(
            "other_rate",
            "warning",
            f"{words}. So the rows are not the samples of the controller, and the times at "
            "which the command changes are not known. Log the command",
            shift,
            0.5 * sample_time,
        )
    else:
        soon = _hasty(columns.time[1:][np.diff(columns.command) != 0.0], sample_time)
        if soon > HASTE:
            yield _no_such_hold(words, soon, sample_time)
        else:
            yield Finding(
                "other_rate",
                "note",
                f"{words}. The command stays constant over several rows, so the controller "
                "samples at the rows where it changes",
                "none, if a fit uses the times at which the command changes",
            )


def _hasty(changes: Array, sample_time: float) -> float:
    """Share of changes of the command that come sooner than a sample time after the last one."""
    return float(np.mean(np.diff(changes) < 0.75 * sample_time)) if changes.size > 1 else 0.0


def _no_such_hold(reason: str, soon: float, sample_time: float) -> Finding:
    return Finding(
        "sample_time",
        "refused",
        f"{reason}, but {100.0 * soon:.0f} % of the changes of the command follow the previous "
        "change after a shorter time. Check sample_time, or leave sample_time out",
        "the model would contain a hold that the loop does not have, which acts like "
        f"{seconds(0.5 * sample_time)} of delay",
    )


def _without_sample_time(
    columns: Columns, rows: Rows, loop: ControlLoop, clock: Clock
) -> Iterator[Finding]:
    own = _own_time(loop)
    if own is not None:
        span = float(columns.time[-1] - columns.time[0])
        if rows.row_time > COARSE * own or span < BRIEF * own:
            yield Finding(
                "time_unit",
                "warning",
                f"the rows are {rows.row_time:g} s apart and last {span:g} s, but a loop with "
                f"these gains takes about {own:.3g} s to respond. Check that the time stamps "
                "are seconds",
                "the delay would be wrong by the same factor as the time stamps",
                math.inf,
            )
            return
    if clock.sample_time_seen is not None:
        held = _is_rough(columns)
        yield Finding(
            "sample_time_seen",
            "warning" if held else "note",
            "the command follows from the controller if the rows are "
            f"{seconds(clock.sample_time_seen)} apart, and "
            + ("the rows are its samples" if held else "the rows may be its samples")
            + f". Give sample_time={clock.sample_time_seen:.6g}",
            "without its hold in the model, the delay is up to half a row, "
            f"{seconds(0.5 * clock.sample_time_seen)}, too long",
        )


def _is_rough(columns: Columns) -> bool:
    """Whether the output holds noise from row to row, which a continuous loop cannot follow."""
    bends = np.diff(columns.output, 2)
    bends = bends[np.abs(bends) > 1e-9 * np.ptp(columns.output)]
    return bool(bends.size > 8 and np.mean(bends[1:] * bends[:-1] < 0.0) > ROUGH)
