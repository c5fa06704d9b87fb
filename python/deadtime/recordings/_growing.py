"""Rows of a loop while it runs: of a table that grows."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from deadtime._base.errors import RecordingError

#: Time between looks at a file that grows, s.
LOOK = 0.1


class Row(NamedTuple):
    """An output, None where it was lost, and the command that was sent then, if any."""

    time: float
    output: float | None
    command: float | None


class Sent(NamedTuple):
    """A command that was sent at a time of its own."""

    time: float
    value: float


def growing_rows(file: Path, columns: Sequence[str], silence: float) -> Iterator[Row]:
    """The rows of a CSV file as they are written, until none has come for `silence` s.

    Parameters
    ----------
    file : Path
        The file, with a header line; lines before it that begin with ``#`` are left out.
    columns : sequence of str
        Names of the columns of time, output and command.
    silence : float
        How long it is waited for another line, s; infinity for ever.

    Yields
    ------
    Row
        An empty cell of output or command is None.

    Raises
    ------
    RecordingError
        If there is no header line, it lacks a column, or a line has a cell that is no number.
    """
    with file.open(encoding="utf-8", newline="") as lines:
        number, head = 1, _whole_line(lines, silence)
        while head is not None and head.startswith("#"):  # as in a saved recording
            number, head = number + 1, _whole_line(lines, silence)
        if head is None:
            raise RecordingError(f"{file} has no header line")
        heads = [name.strip() for name in next(csv.reader([head]))]
        for name in columns:
            if name not in heads:
                raise RecordingError(f"{file} has no column {name!r}, only {', '.join(heads)}")
        places = [heads.index(name) for name in columns]
        while (line := _whole_line(lines, silence)) is not None:
            number += 1
            cells = next(csv.reader([line]), [])
            if not cells:
                continue
            try:
                found = [float(cells[place] or "nan") for place in places]
            except (ValueError, IndexError):
                raise RecordingError(
                    f"line {number} of {file} is {line.strip()!r}: give a number for each of "
                    f"{', '.join(columns)}"
                ) from None
            when, output, command = found
            yield Row(
                when,
                None if math.isnan(output) else output,
                None if math.isnan(command) else command,
            )


def _whole_line(lines: object, silence: float) -> str | None:
    """The next line once its end is written; None after a silence."""
    text, since = "", time.monotonic()
    while not text.endswith("\n"):
        more = lines.readline()  # type: ignore[attr-defined]
        if more:
            text, since = text + more, time.monotonic()
        elif time.monotonic() - since > silence:
            return text or None
        else:
            time.sleep(LOOK)
    return text
