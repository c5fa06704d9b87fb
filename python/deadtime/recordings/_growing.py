"""Rows of a loop while it runs: of a table that grows."""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from deadtime._base.errors import RecordingError
from deadtime.recordings._first_bytes import HEAD, format_of, opened
from deadtime.recordings.readers._text import UTF_16, cells, header_of, not_text

#: Time between looks at a file that grows, s.
LOOK = 0.1

#: Longest line, characters: a file without line ends is no table.
LONGEST = 100_000

#: Characters of a line that an error shows.
SHOWN = 80

#: A number whose comma may stand before thousands.
_THOUSAND = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


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

    Encodings, separators and decimal commas are those of `read_recording`; a file packed by gzip
    cannot be followed.

    Parameters
    ----------
    file : Path
        The file, with a header line; lines that begin with ``#`` are left out.
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
        If it is no text, there is no header line, it lacks a column, a line has a cell that is no
        finite number, or it has more than 100 000 characters.
    """
    lines = enumerate(_lines(file, silence), 1)
    kept = ((n, line) for n, line in lines if line.strip() and not line.startswith("#"))
    _, first = next(kept, (0, ""))
    if not first:
        raise RecordingError(f"{file} has no header line")
    heads, delimiter = header_of(file, _in_latin_1(first), columns, None)
    for name in columns:
        if name not in heads:
            raise RecordingError(
                f"{file} has no column {name!r}. Its columns are {', '.join(heads)}"
            )
    places = [heads.index(name) for name in columns]
    numbers = _Numbers()
    for number, line in kept:
        try:
            found = cells(line, delimiter)
            when, output, command = numbers.of([found[place] for place in places])
            if when is None:
                raise ValueError
        except (ValueError, IndexError, csv.Error) as error:
            shown = line.strip() if len(line) <= SHOWN else f"{line[:SHOWN]}..."
            reason = str(error) if isinstance(error, _MarkError) else "give a finite number"
            raise RecordingError(
                f"line {number} of {file} is {shown!r}: {reason} for each of the columns "
                f"{', '.join(columns)}"
            ) from None
        yield Row(when, output, command)


class _MarkError(ValueError):
    """A comma that is no decimal comma for certain."""


class _Numbers:
    """The numbers in cells, with one decimal mark in all of them."""

    def __init__(self) -> None:
        self._marks: set[str] = set()
        self._is_decimal = False

    def of(self, row: Sequence[str]) -> list[float | None]:
        """The numbers of a row; None for an empty cell and for NaN."""
        self._marks.update(mark for mark in ".," for cell in row if mark in cell)
        commas = [cell for cell in row if "," in cell]
        self._is_decimal |= not all(map(_THOUSAND.fullmatch, commas))
        if len(self._marks) > 1 or (commas and not self._is_decimal):
            raise _MarkError("write a decimal point")
        found = [float(cell.replace(",", ".") or "nan") for cell in row]
        if any(map(math.isinf, found)):
            raise ValueError
        return [None if math.isnan(value) else value for value in found]


def _lines(file: Path, silence: float) -> Iterator[str]:
    """The lines once their ends are written; the last one after a silence."""
    text, decoder, since, count = "", None, time.monotonic(), 0
    with opened(file) as stream:
        while (data := stream.read(HEAD)) or time.monotonic() - since <= silence:
            if not data:
                time.sleep(LOOK)
                continue
            decoder = decoder or _decoder(file, data)
            *whole, text = (text + decoder.decode(data)).split("\n")
            for line in (*whole, text):
                if len(line) > LONGEST:
                    raise RecordingError(
                        f"line {count + 1} of {file} has more than {LONGEST} characters, so "
                        "this is not a line of a table"
                    )
                count += 1
            count -= 1
            yield from whole
            since = time.monotonic()
    text += decoder.decode(b"", final=True) if decoder else ""
    if text:
        yield text.removesuffix("\n")


def _decoder(file: Path, head: bytes) -> io.IncrementalNewlineDecoder:
    """What makes text of a file that begins so, with lines that end in a line feed."""
    kind = format_of(file, head, "read_recording")
    if kind is None:
        raise not_text(file)
    if kind != "text":
        raise RecordingError(f"{file} is a file of {kind}, but --follow can read only a text file")
    # Bytes that are not UTF-8 are kept, as those of Latin-1 in a header.
    name, errors = (
        ("utf-16", "replace") if head.startswith(UTF_16) else ("utf-8-sig", "surrogateescape")
    )
    return io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(name)(errors), translate=True)


def _in_latin_1(line: str) -> str:
    """A line, in Latin-1 if it is not in UTF-8."""
    if any("\udc80" <= sign <= "\udcff" for sign in line):
        return line.encode("utf-8", "surrogateescape").decode("latin-1")
    return line
