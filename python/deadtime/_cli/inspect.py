"""``deadtime inspect``: what the log of an autopilot holds."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from deadtime._cli import options as opt
from deadtime._cli.exit_codes import NONE
from deadtime._cli.fills import filled
from deadtime._cli.show import print_json, print_points, print_table, print_text, results_table
from deadtime.logs import (
    Bag,
    Log,
    LogLoop,
    Promise,
    advice,
    filter_lines,
    filters_of,
    is_bag,
    open_bag,
    open_log,
    promises_of,
)

#: Heads of the table of loops; the last is to what these rows tell the time from setpoint to
#: response.
HEADS = ("loop", "setpoint", "response", "rows/s", "followed", "with these rows")

#: The parts of a quaternion in the name of a signal, which make it long.
_QUATERNION = re.compile(r"\[0\]….*")

#: Letters that two lines of a screen hold, less what is said of the rest.
TWO_LINES = 160


@filled
def command(
    log: Annotated[Path, typer.Argument(show_default=False)],
    loop: str | None = None,
    flight: opt.Flight = None,
    as_json: opt.As_json = False,
) -> None:
    """List what an autopilot's log contains: vehicle, modes, loops, rates, gains.

    Parameters
    ----------
    log
        A log file: ULog, DataFlash (.bin or .log), tlog, Blackbox or Crazyflie uSD. Or a bag (MCAP
        or ROS), whose topics and fields are listed.
    loop
        Show only this loop, such as 'roll rate'.

    Exit codes: 0 for an answer, 3 if the log contains no loop, 1 for an error.
    """
    if is_bag(log):
        if loop is not None or flight is not None:
            raise ValueError(
                f"{log} is a bag, so it has topics instead of loops and flights: leave --loop "
                "and --flight out"
            )
        _print_bag(open_bag(log), as_json)
        return
    found = open_log(log, flight=flight)
    if loop is not None:
        log_loop = found.loop(loop)
        if as_json:
            print_json("log-loop", log_loop.to_dict())
        else:
            _print_loop(log_loop)
    elif as_json:
        filters = [part._asdict() for part in filters_of(found)]
        promises = {name: promise.to_dict() for name, promise in promises_of(found).items()}
        print_json("log", {**found.to_dict(), "filters": filters, "promises": promises})
    else:
        _print_log(found)
    if not found.loops and found.link is None:
        raise typer.Exit(NONE)


def _print_bag(bag: Bag, as_json: bool) -> None:
    """The topics of a bag with their rates, and their fields as other commands take them."""
    if as_json:
        print_json("bag", bag.to_dict())
        return
    headline, *lines = bag.summary().splitlines()
    print_text(headline, "bold")
    for line in lines:
        print_text(line, wrapped=False)


def _print_log(log: Log) -> None:
    """The log, its loops as a table, and the reasons why some time of them is left out."""
    vehicle = " ".join(part for part in (log.autopilot, log.vehicle) if part) or "unknown vehicle"
    print_text(f"{log.source}: {log.format} of {vehicle}, {log.duration:.2f} s", "bold")
    if log.firmware:
        print_text(f"firmware: {log.firmware}")
    if log.modes:
        _print_some("modes", [f"{name} from {at:.2f} s" for at, name in log.modes])
    if log.loops:
        promises = promises_of(log)
        rows = [_row(loop, promises.get(loop.name)) for loop in log.loops.values()]
        print_table(results_table(HEADS, rows, left=("loop", "setpoint", "response")))
        print_points(_reasons(log))
    else:
        print_text("for no loop the log contains both the setpoint and the response", "yellow")
    if log.key_parameters:
        _print_some(
            "parameters", [f"{name} {value:g}" for name, value in log.key_parameters.items()]
        )
    for line in filter_lines(log):
        print_text(line)
    for suggestion in advice(log):
        print_text(f"next: {suggestion.text}")
    if log.link is not None:
        print_text(log.link.summary())
    for remark in log.remarks:
        print_text(remark, "yellow")


def _print_some(what: str, words: list[str]) -> None:
    """As many words as two lines of a screen hold; the rest is counted."""
    kept = words
    while len(kept) > 1 and len(", ".join(kept)) + len(what) > TWO_LINES:
        kept = kept[:-1]
    more = f" and {len(words) - len(kept)} more: --json" if len(kept) < len(words) else ""
    print_text(f"{what}: {', '.join(kept)}{more}")


def _row(loop: LogLoop, promise: Promise | None) -> tuple[str, ...]:
    rates = dict.fromkeys(f"{signal.rate:.3g}" for signal in (loop.setpoint, loop.response))
    return (
        loop.name,
        *(_QUATERNION.sub("", signal.source) for signal in (loop.setpoint, loop.response)),
        ", ".join(rates),
        f"{loop.followed:.1f} s" if loop.segments else "never",
        "" if promise is None else promise.short(),
    )


def _reasons(log: Log) -> list[str]:
    """Each reason once, with the loops of which it leaves time out."""
    names: dict[str, list[str]] = {}
    for loop in log.loops.values():
        for sentence in loop.why_left_out:
            names.setdefault(sentence.partition(": ")[2] or sentence, []).append(loop.name)
    return [
        f"rows left out because x.py:61|{reason} is a bag, which has topics but no loops or "
        "flights: leave --loop and --flight out "
        + ("all loops" if len(found) == len(log.loops) else ", ".join(found))
        for reason, found in names.items()
    ]


def _print_loop(loop: LogLoop) -> None:
    headline, *details = loop.summary().splitlines()
    print_text(headline, "bold")
    for line in details:
        print_text(line)
