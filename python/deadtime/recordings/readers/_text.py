"""The text of a CSV file: unpacked, in one encoding, with its header and its separator."""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from collections.abc import Collection
from dataclasses import dataclass

from deadtime._base.errors import RecordingError
from deadtime.recordings._first_bytes import HEAD, format_of
from deadtime.recordings.readers._columns import column_index
from deadtime.recordings.readers._limits import largest

#: Separators, the likelier ones first.
DELIMITERS = (",", ";", "\t", " ")

#: Marks at the begin of a text in UTF-16.
UTF_16 = (b"\xff\xfe", b"\xfe\xff")

#: Most characters of a line that a message shows.
SHOWN = 40

#: A cell that is a number, a date or empty, and so no name of a column.
_VALUE = re.compile(r"([-+]?[\d.,]*\d[.,]?(e[-+]?\d+)?|nan|\d{4}-\d\d-\d\d[T \d:.,+Z-]*)?", re.I)

_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")


@dataclass(frozen=True)
class Text:
    """A table in text.

    Attributes
    ----------
    path : object
        The file, for messages.
    comments : tuple of str
        The lines before the header that begin with ``#``.
    header : list of str
        Names of the columns.
    delimiter : str
        Separator of the columns; a space stands for any number of them.
    raw : bytes
        The text; every character that counts is one byte.
    start : int
        Where in it the lines below the header begin.
    encoding : str
        Of the text.
    line : int
        Number of the first line below the header, from 1.
    """

    path: object
    comments: tuple[str, ...]
    header: list[str]
    delimiter: str
    raw: bytes
    start: int
    encoding: str
    line: int

    @property
    def body(self) -> bytes:
        """The lines below the header."""
        return self.raw[self.start :]


def as_text(path: object, raw: bytes, wanted: Collection[str], delimiter: str | None) -> Text:
    """Find the header of a file, and the separator under which it holds the `wanted` names."""
    if delimiter is not None and (len(delimiter) != 1 or delimiter in '"\r\n'):
        raise RecordingError(
            f"delimiter={delimiter!r}: give one character, but not a quote or a line end"
        )
    text, encoding = _decodable(path, raw)
    comments = []
    start, number = 0, 0
    while start < len(text):
        stop = text.find(b"\n", start) + 1 or len(text)
        line = text[start:stop].decode(encoding).strip(" \r\n\f\v")
        start, number = stop, number + 1
        if line.startswith("#"):
            comments.append(line)
        elif line.strip():
            if _CONTROL.search(line):
                raise not_text(path)
            header, delimiter = header_of(path, line, wanted, delimiter)
            return Text(path, tuple(comments), header, delimiter, text, start, encoding, number + 1)
    raise RecordingError(f"{path} is empty: a header line and samples are needed")


def not_text(path: object) -> RecordingError:
    """What is wrong with a file of no known format."""
    return RecordingError(
        f"{path} is neither a text file nor of another format that can be read: give a CSV, "
        "Parquet, Arrow or MAT file"
    )


def _decodable(path: object, raw: bytes) -> tuple[bytes, str]:
    """The text in UTF-8 or Latin-1 without a mark, with lines that end in a line feed."""
    if raw.startswith(b"\x1f\x8b"):
        raw = _unpacked(path, raw)
        if format_of(path, raw[:HEAD], "read_recording") not in (None, "text"):
            raise RecordingError(
                f"{path} is compressed by gzip, but does not contain text: unpack the file"
            )
    encoding = "utf-8"
    if raw.startswith(UTF_16):
        try:
            raw = raw.decode("utf-16").encode()
        except UnicodeError:
            raise not_text(path) from None
    elif not raw.isascii():
        raw = raw.removeprefix(b"\xef\xbb\xbf")
        try:
            raw.decode()
        except UnicodeDecodeError:
            encoding = "latin-1"
    if b"\0" in raw:
        raise not_text(path)
    if b"\r" in raw and b"\n" not in raw:
        raw = raw.replace(b"\r", b"\n")
    return raw, encoding


def _unpacked(path: object, raw: bytes) -> bytes:
    limit = largest(len(raw))
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(raw)) as stream:
            text = stream.read(limit + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(f"{path} is damaged and cannot be unpacked: {error}") from None
    if len(text) > limit:
        raise RecordingError(
            f"{path} has {len(raw)} bytes, but more than {limit} bytes when unpacked. If this "
            "is right, unpack the file yourself"
        )
    return text


def header_of(
    path: object, line: str, wanted: Collection[str], delimiter: str | None
) -> tuple[list[str], str]:
    """Names of the columns, and the separator: where none is given, one that finds most of them.

    Numbers are names only where one of them is wanted.
    """
    headers, wrong = {}, None
    for sep in delimiter or DELIMITERS:
        try:
            headers[sep] = cells(line, sep)
        except csv.Error as error:
            wrong = error
    if not headers:
        raise RecordingError(f"{path} is not a CSV file: {wrong}")
    best = max(headers, key=lambda sep: (len({*wanted} & {*headers[sep]}), len(headers[sep]) > 1))
    if {*wanted}.isdisjoint(headers[best]) and any(map(_are_values, headers.values())):
        raise RecordingError(
            f"the first line of {path} contains numbers, {line.strip()[:SHOWN]!r}. Add a line "
            "with the names of the columns above, such as time,reference,output,command"
        )
    return headers[best], best


def _are_values(row: list[str]) -> bool:
    """Whether cells are those of a sample, and no names."""
    return any(row) and all(_VALUE.fullmatch(cell) for cell in row)


def cells(line: str, delimiter: str) -> list[str]:
    """The cells of one line, without the blanks round them."""
    if delimiter == " ":
        line = " ".join(line.split())
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True))]


def indices(text: Text, names: dict[str, str]) -> dict[str, int]:
    """Index of the column for each signal."""
    return {
        signal: column_index(text.path, text.header, signal, name) for signal, name in names.items()
    }
