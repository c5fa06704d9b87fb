"""What is most worth knowing about the times of a log, in five lines below their table."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from deadtime._base.digits import stated
from deadtime._base.verdicts import Verdict
from deadtime.logs.latencies._advice import Advice
from deadtime.logs.latencies._beside import CONTRADICTED
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.logs.latencies._table import ROWS, SCREEN, about

#: Most lines, how many of them are kept for what to log and to fly, and most on loops without a
#: time.
LINES, ADVICE, NONES = 5, 1, 2

#: Probability of the scatter of windows below which their spread is said.
DIFFER = 0.01

#: Names of loops that a line has; more are counted.
NAMED = 3

#: Numbers with their units: reasons that differ in these alone are one reason.
_NUMBERS = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?(?: (?:s|ms|µs|ppm)\b)?")

#: A reason why time of a loop is left out, as `LogLoop.why_left_out` has it.
_LEFT_OUT = re.compile(r"([\d.]+) s are left out: (.*)")

#: Where a sentence may end before its end.
_ENDS = re.compile("; |: |, which |, or ")


def below(
    loops: Sequence[LoopLatency], advice: Sequence[Advice], others: str = "--verbose"
) -> list[str]:
    """At most five lines: what is most worth knowing, and what to log and to fly to know more.

    `others` is where there is more on loops that have no line.
    """
    lines = [_left_out(loops, others), _spread(loops)]
    lines += [*_groups(loops, "indication")[:1], _contradicted(loops), *_without(loops, others)]
    lines = [line for line in lines if line][: LINES - min(ADVICE, len(advice))]
    more = [shortened("next: ", suggestion.text) for suggestion in advice]
    return [*lines, *more[: LINES - len(lines)]]


def refused_of(loops: Sequence[LoopLatency]) -> list[tuple[str, str]]:
    """The names of the loops without a time that share a reason, and the whole reason."""
    groups: dict[str, list[LoopLatency]] = {}
    for loop in loops:
        if loop.verdict == "none":
            groups.setdefault(loop.reason, []).append(loop)
    return [(names_of(some, len(some)), reason) for reason, some in groups.items()]


def shortened(before: str, text: str, after: str = "") -> str:
    """Words with a text between, of which as many parts are kept as fit on a screen."""
    width = SCREEN - len(before) - len(after)
    if len(text) > width:
        ends = [end.start() for end in _ENDS.finditer(text)]
        text = text[: max([end for end in ends if end <= width], default=min(ends, default=None))]
    return f"{before}{text}{after}"


def grouped(loops: Sequence[LoopLatency]) -> list[list[LoopLatency]]:
    """Loops that share the first of their reasons, the largest group first."""
    groups: dict[str, list[LoopLatency]] = {}
    for loop in loops:
        groups.setdefault(_NUMBERS.sub("#", first_reason(loop)), []).append(loop)
    return sorted(groups.values(), key=len, reverse=True)


def first_reason(loop: LoopLatency) -> str:
    """The first reason why a time is not reliable; the one that leaves out most of the log."""
    parts = loop.reason.split("; ")
    left_out = [found for found in map(_LEFT_OUT.fullmatch, parts) if found]
    if not left_out:
        return parts[0]
    return max(left_out, key=lambda found: float(found[1]))[2]


def names_of(loops: Sequence[LoopLatency], most: int = NAMED) -> str:
    """Names of loops: ``"roll, pitch"``, or ``"roll; from actuator pitch"`` of what is not both."""
    commands: dict[str, list[str]] = {}
    for loop in loops:
        commands.setdefault(loop.loop, []).append(loop.command)
    alone = [name for name, some in commands.items() if some == ["actuator"]]
    first = [name for name in commands if name not in alone]
    left = max(most - len(first), 0)
    parts = [", ".join(first[:most])] if first else []
    if alone[:left]:
        parts.append(f"from actuator {', '.join(alone[:left])}")
    more = f" and {len(commands) - most} more" if len(commands) > most else ""
    return "; ".join(parts) + more


def _groups(loops: Sequence[LoopLatency], verdict: Verdict) -> list[str]:
    """A line for the loops of a verdict that share a reason, whose numbers are of the first."""
    lines = []
    for alike in grouped([loop for loop in loops if loop.verdict == verdict]):
        reason = first_reason(alike[0])
        same = [loop for loop in alike if first_reason(loop) == reason]
        others = [loop for loop in alike if first_reason(loop) != reason]
        after = f"; likewise {names_of(others)}" if others else ""
        lines.append(shortened(f"{verdict}: {names_of(same)}: ", reason, after))
    return lines


def _contradicted(loops: Sequence[LoopLatency]) -> str:
    """Where a plain number contradicts the fit, unless that is the first reason of its loop."""
    found = []
    for loop in loops:
        reasons = [each for each in loop.reason.split("; ") if CONTRADICTED in each]
        if loop.verdict == "indication" and reasons and reasons[0] != first_reason(loop):
            found.append(replace(loop, reason=reasons[0]))
    return next(iter(_groups(found, "indication")), "")


def _without(loops: Sequence[LoopLatency], others: str) -> list[str]:
    """The lines on loops without a time, those first that were fitted, then those tried."""
    none = [loop for loop in loops if loop.verdict == "none"]
    fitted = [loop for loop in none if loop.windows]
    tried = [loop for loop in none if not loop.windows and loop.sampling is not None]
    rest = [loop for loop in none if not loop.windows and loop.sampling is None]
    lines = [line for some in (fitted, tried, rest) for line in _groups(some, "none")]
    if len(lines) > NONES:
        lines = [*lines[: NONES - 1], f"{lines[NONES - 1]}; for others: {others}"]
    return lines


def _left_out(loops: Sequence[LoopLatency], others: str) -> str:
    """How many times had no room in the table."""
    count = sum(loop.verdict != "none" for loop in loops) - ROWS
    return f"{count} more time{'' if count == 1 else 's'}: {others}" if count > 0 else ""


def _spread(loops: Sequence[LoopLatency]) -> str:
    """How the time of a loop changes with the size of the movement, or between windows."""
    slopes, differ = [], []
    for loop in loops:
        if loop.verdict == "none" or loop.spread is None:
            continue
        if (halved := loop.spread.halved()) is not None:
            slopes.append((abs(halved[0]) / loop.time, halved, loop))
        elif loop.spread.p_value < DIFFER:
            differ.append((loop.spread.between / loop.time, loop.spread.between, loop))
    if slopes:
        _, (change, error), loop = max(slopes, key=lambda each: each[0])
        way = "longer" if change > 0.0 else "less"
        return (
            f"{names_of([loop])} takes {stated(abs(change), error, 's')} {way} if the "
            f"{loop.command} moves half as much"
        )
    if differ:
        _, between, loop = max(differ, key=lambda each: each[0])
        return (
            f"{names_of([loop])}: the time changes during the log, with a standard deviation of "
            f"{about(between, 's')} between windows"
        )
    return ""
