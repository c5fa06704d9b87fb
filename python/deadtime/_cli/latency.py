"""``deadtime latency``: how long the loops of a vehicle take to respond, from one log or two."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.digits import between, stated
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.exit_codes import NONE
from deadtime._cli.interruption import without_waiting_for_threads
from deadtime._cli.show import console, print_json, print_table, print_text, results, results_table
from deadtime.logs import (
    Latency,
    LatencyTable,
    Log,
    LoopLatency,
    compare_latencies,
    heading_of,
    is_bag,
    latency,
    loops_asked_for,
    open_bag,
    open_log,
)
from deadtime.recordings import Recording, is_table, read_recording

#: Shortest log, s: the fastest rate loop takes 30 ms to respond, and has to be seen doing it twice.
SHORTEST = 0.1

#: Topics of a bag that an error lists.
LISTED = 12

LEFT = ("loop", "from", "outcome")


def command(
    logs: Annotated[
        list[Path],
        typer.Argument(
            help="A log file, or two log files to compare. Formats: ULog, DataFlash (.bin or "
            ".log), tlog, Blackbox, a table (CSV), or a bag (MCAP, ROS).",
            show_default=False,
        ),
    ],
    axis: Annotated[
        list[str] | None,
        typer.Option(
            help=("Show only loops of this axis. For several axes, repeat the option."),
            show_default=False,
        ),
    ] = None,
    loop: Annotated[
        list[str] | None,
        typer.Option(
            help=(
                "Show only this loop, such as 'roll rate', with all details. For several loops, "
                "repeat the option."
            ),
            show_default=False,
        ),
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Also print each loop in detail, below the table.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help=("Write a page with all fits of one log to this file."), show_default=False
        ),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(
            help="Signal that the loop has to follow: a column of a table, or TOPIC:FIELD of a "
            "bag.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            help=("Response of the loop: a column of a table, or TOPIC:FIELD of a bag."),
            show_default=False,
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(
            help=(
                "Column of a table with the signal that the loop has to follow. Use it instead "
                "of --command."
            ),
            show_default=False,
        ),
    ] = None,
    time: opt.Time = None,
    flight: opt.Flight = None,
    as_json: opt.As_json = False,
) -> None:
    """Show how long each loop takes to respond, in which stages, and which gains are possible.

    Exit codes: 0 for a time, reliable or an indication; 3 for no time; 1 for an error.
    """
    if len(logs) > 2:
        raise ValueError(f"{len(logs)} logs were given: give one log, or two logs to compare")
    if out is not None:
        check_pages()
        if len(logs) > 1:
            raise ValueError(
                "--out writes a page about one log, but two logs are given: give one log, or "
                "leave --out out"
            )
    columns = {"time": time, "reference": reference, "output": output, "command": command}
    found = []
    with without_waiting_for_threads():
        for path in logs:
            log = _opened(path, columns, flight)
            found.append(_estimated(log, axis, loop, as_json, verbose))
    if as_json:
        _print_json(found)
    elif len(found) == 2:
        _print_changes(*found)
    if out is not None:
        written = found[0].report(out)
        if not as_json:
            print_text(f"report: {written}", wrapped=False)
    if not any(result.estimated for result in found):
        raise typer.Exit(NONE)


def _opened(path: Path, columns: Mapping[str, str | None], flight: int | None) -> Log | Recording:
    """A log, or the recording of named columns of a table or fields of a bag."""
    named = [f"--{name}" for name, column in columns.items() if column is not None]
    # What is no file, such as a pipe, can be read only once.
    kept = path.is_file() or path.is_dir()
    if kept and is_bag(path):
        return _of_bag(path, columns)
    if kept and is_table(path):
        # A reference alone is followed; otherwise a command of a usual name is looked for.
        followed = columns["command"] or (None if columns["reference"] else "auto")
        return read_recording(
            path,
            time=columns["time"],
            reference=columns["reference"],
            output=columns["output"],
            command=followed,
        )
    found = open_log(path, flight=flight)
    if named:
        raise ValueError(
            f"{path} is a {found.format} log, whose loops are already known: leave "
            f"{', '.join(named)} out"
        )
    if found.duration < SHORTEST:
        raise NotIdentifiableError(
            f"{found.source} lasts only {stated(found.duration, 0.0, 's')}, which is too short "
            "for the response of a loop: give a longer log"
        )
    return found


def _of_bag(path: Path, columns: Mapping[str, str | None]) -> Recording:
    bag = open_bag(path)
    commands, outputs = columns["command"], columns["output"]
    if commands is None or outputs is None:
        names = [f"{name}:{field}" for name, topic in bag.topics.items() for field in topic.fields]
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        raise ValueError(
            f"{path} is a bag: give the setpoint by --command and the response by --output, each "
            "as TOPIC:FIELD. The topics and fields of this bag are "
            f"{', '.join(names[:LISTED]) or 'none'}{more}"
        )
    if columns["time"] is not None:
        raise ValueError(
            f"{path} is a bag, whose messages have times of their own: leave --time out"
        )
    return bag.recording(commands, outputs, columns["reference"])


def _estimated(
    log: Log | Recording,
    axes: list[str] | None,
    loops: list[str] | None,
    quiet: bool,
    verbose: bool,
) -> Latency:
    """The times of a log, each printed as soon as it is found."""
    wanted = loops_asked_for(log, axes, loops)
    table = LatencyTable(wanted, console.width if console.is_terminal else None)
    in_full = loops is not None
    if not (quiet or in_full):
        print_text(f"{heading_of(log)}\n", wrapped=False)
        print_text(table.head(), "bold", wrapped=False)
    with results(f"{len(wanted)} times", len(wanted), quiet=quiet) as tell:

        def show(result: LoopLatency) -> None:
            tell(None if in_full else table.row(result))

        found = latency(log, axes=axes, loops=loops, progress=show)
    if quiet:
        return found
    if not in_full:
        print_text("")
        for line in found.below():
            print_text(line)
    if in_full or verbose:
        print_text(found.details())
    return found


def _print_json(found: list[Latency]) -> None:
    if len(found) == 1:
        print_json("latency", found[0].to_dict())
        return
    changes = [change.to_dict() for change in compare_latencies(*found)]
    print_json("latency-change", {"logs": [log.to_dict() for log in found], "changes": changes})


def _print_changes(first: Latency, second: Latency) -> None:
    changes = compare_latencies(first, second)
    if not changes:
        print_text("for no loop a response time was found in both logs", "yellow")
        return
    rows = [
        (
            change.loop,
            change.command,
            stated(change.before, change.before_error, "s"),
            stated(change.after, change.after_error, "s"),
            between(*change.ci, change.stderr, "s"),
            change.outcome,
        )
        for change in changes
    ]
    heads = ("loop", "from", first.source, second.source, "change, 95 %", "outcome")
    print_table(results_table(heads, rows, left=LEFT))
