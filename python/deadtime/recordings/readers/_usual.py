"""Columns by their usual names, where the caller names none."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence

from deadtime._base.errors import RecordingError
from deadtime._base.usual_columns import SECOND_IN, UNITS, USUAL
from deadtime.recordings.readers._columns import column_index

_BRACKETS = re.compile(r"\s*[(\[]\s*([^)\]]*?)\s*[)\]]\s*$")


def chosen_columns(
    label: object, names: Sequence[str], given: Mapping[str, str | None], optional: set[str]
) -> dict[str, str]:
    """The column of each signal: the one that is given, or one of a usual name.

    Parameters
    ----------
    label : object
        What messages call the table.
    names : sequence of str
        Names of its columns.
    given : mapping of str to str or None
        Name of the column by signal, None where it is to be found.
    optional : set of str
        Signals that need not be there.
    """
    found = {signal: name for signal, name in given.items() if name is not None}
    for signal, name in found.items():
        column_index(label, names, signal, name)
    for signal in given:
        if signal in found:
            continue
        free = [name for name in names if name not in found.values()]
        # A vehicle that is told its reference has one column for both.
        usual = _usual(signal, free) or (_usual(signal, names) if signal == "reference" else None)
        if usual is not None:
            found[signal] = usual
        elif signal == "reference" and "command" not in given and _usual("command", free):
            # Of a bump test there is a command alone.
            found["command"] = str(_usual("command", free))
        elif signal not in optional:
            shown = ", ".join(map(repr, names[:12])) + (", …" if len(names) > 12 else "")
            raise RecordingError(
                f"{label} has no column with a usual name for the "
                f"{signal}{' in s' * (signal == 'time')}, such as {USUAL[signal][0]!r} or "
                f"{USUAL[signal][1]!r}. Its columns are {shown}. Name the column by {signal}=, "
                f"or by --{signal} on the command line"
            )
    return {
        signal: found[signal] for signal in dict.fromkeys([*given, "command"]) if signal in found
    }


def _usual(signal: str, names: Sequence[str]) -> str | None:
    """The first column of the likeliest usual name."""
    units = SECOND_IN if signal == "time" else UNITS
    plain = [(name, *_plain(name, units)) for name in names]
    if signal == "time":
        plain = [column for column in plain if column[2] in SECOND_IN]
    for usual in USUAL[signal]:
        # As it is written, before other capitals: t is a time beside a temperature T.
        exact = [name for name, _, _ in plain if name == usual]
        alike = exact or [name for name, short, _ in plain if short == usual]
        if alike:
            return alike[0]
    return None


def second_in(name: str) -> float:
    """How many of the unit that a column of times names make a second; 1 where it names none."""
    return SECOND_IN.get(_plain(name, SECOND_IN)[1], 1.0)


def _plain(name: str, units: Container[str]) -> tuple[str, str]:
    """A name in small letters without its unit, and the unit."""
    brackets = _BRACKETS.search(name)
    unit = brackets[1].lower() if brackets else ""
    short = re.sub(
        r"[\s.-]+", "_", (name[: brackets.start()] if brackets else name).strip().lower()
    )
    head, _, last = short.rpartition("_")
    return (head, last) if head and not unit and last in units else (short, unit)
