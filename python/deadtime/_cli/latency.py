"""``deadtime latency``: how long the loops of a vehicle take to respond, from one log or two."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deadtime._base.digits import between, stated
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.exit_codes import NONE
from deadtime._cli.show import print_json, print_table, print_text, results, results_table
from deadtime.logs import Latency, Log, compare_latencies, latency, loops_asked_for, open_log

#: Shortest log, s: the fastest rate loop takes 30 ms to respond, and has to be seen doing it twice.
SHORTEST = 0.1

LEFT = ("loop", "from", "why")


def command(
    logs: Annotated[
        list[Path],
        typer.Argument(
            help="A log file, or two to compare: ULog, DataFlash (.bin or .log), tlog, Blackbox.",
            show_default=False,
        ),
    ],
    axis: Annotated[
        list[str] | None,
        typer.Option(help="Only loops of this axis; may be repeated.", show_default=False),
    ] = None,
    loop: Annotated[
        list[str] | None,
        typer.Option(
            help="Only this loop, for example 'roll rate'; may be repeated.", show_default=False
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write a page with all fits, for one log.", show_default=False),
    ] = None,
    flight: opt.Flight = None,
    as_json: opt.As_json = False,
) -> None:
    """Tell how long each loop of a vehicle takes to respond, by stage, and what that costs."""
    if len(logs) > 2:
        raise ValueError(f"{len(logs)} logs were given: give one, or two to compare")
    if out is not None:
        check_pages()
        if len(logs) > 1:
            raise ValueError("--out writes the page of one log: give one, or leave it out")
    found = [_told(open_log(one, flight=flight), axis, loop, as_json) for one in logs]
    # Before anything is printed: whoever reads the output may close it.
    written = None if out is None else found[0].report(out)
    if as_json and len(found) == 1:
        print_json("latency", found[0].to_dict())
    elif as_json:
        changes = [one.to_dict() for one in compare_latencies(*found)]
        print_json("latency-change", {"logs": [one.to_dict() for one in found], "changes": changes})
    else:
        for one in found:
            _print(one)
        if len(found) == 2:
            _print_changes(*found)
    if written is not None and not as_json:
        print_text(f"report: {written}")
    if not any(one.estimated for one in found):
        raise typer.Exit(NONE)


def _told(log: Log, axes: list[str] | None, loops: list[str] | None, quiet: bool) -> Latency:
    if log.duration < SHORTEST:
        raise NotIdentifiableError(
            f"{log.source} is {stated(log.duration, 0.0, 's')} long, in which no loop of a vehicle "
            "responds: give a longer log"
        )
    count = loops_asked_for(log, axes, loops)
    with results(f"{log.source}, {count} times", count, quiet=quiet) as tell:
        return latency(log, axes=axes, loops=loops, progress=tell)


def _print(found: Latency) -> None:
    headline, first, *rest = found.summary().splitlines()
    print_text(headline, "bold")
    print_text(first, "bold")
    for line in rest:
        print_text(line)


def _print_changes(one: Latency, other: Latency) -> None:
    changes = compare_latencies(one, other)
    if not changes:
        print_text("no loop is told by both logs", "yellow")
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
    heads = ("loop", "from", one.source, other.source, "change, 95 %", "outcome")
    print_table(results_table(heads, rows, left=(*LEFT, "outcome")))
