"""Read recordings from CSV files."""

from __future__ import annotations

import csv
import difflib
import math
import os
import re
from collections.abc import Iterator
from pathlib import Path

from deadtime._base.errors import RecordingError
from deadtime._base.validation import OpenRange, open_interval
from deadtime.recordings._recording import Recording

DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


def read_recording(
    path: str | os.PathLike[str],
    *,
    time: str = "time",
    reference: str = "reference",
    output: str = "output",
    command: str | None = None,
    window: OpenRange | None = None,
    delimiter: str | None = None,
) -> Recording:
    r"""Read a recording from a CSV file with a header line.

    Parameters
    ----------
    path : path-like
        The file. Text, one line of column names, then one line a sample. Lines that begin with
        ``#`` and empty lines are skipped.
    time, reference, output : str
        Names of the columns that hold the time stamps (s), the reference and the measurement.
    command : str, optional
        Name of the column that holds the command sent to the plant.
    window : (low, high), optional
        Keep only the rows between these times, s; None leaves an end open.
    delimiter : str, optional
        Separator of the columns; found from the header line if not given.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError
        When the file cannot be read, is not such a text, lacks a column, holds a value that is no
        finite number, a time that does not increase, a constant reference, or too few samples.
        The message names the line.

    Examples
    --------
    >>> import deadtime as dtm, pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> rows = [f"{k / 10},{int(k > 4)},{max(0, k - 6) / 10}" for k in range(20)]
    >>> _ = file.write_text("t_s,ref_m,height_m\n" + "\n".join(rows))
    >>> recording = dtm.read_recording(file, time="t_s", reference="ref_m", output="height_m")
    >>> len(recording), recording.steps()[0].time
    (20, 0.5)
    """
    path = Path(path)
    names = {"time": time, "reference": reference, "output": output}
    if command is not None:
        names["command"] = command
    header, lines = _table(path, delimiter)
    columns_of = {signal: _column_of(path, header, signal, name) for signal, name in names.items()}
    low, high = _ends(window)
    columns: dict[str, list[float]] = {signal: [] for signal in names}
    last = None
    for number, cells in lines:
        _check_width(path, number, cells, len(header))
        now = _value(path, number, cells, columns_of["time"], time)
        if last is not None and now <= last:
            what = "repeats" if now == last else "goes back"
            raise RecordingError(
                f"{path}, line {number}: the time {what} ({last!r} is followed by {now!r}); sort "
                "the rows and keep one of each time stamp"
            )
        last = now
        if not low <= now <= high:
            continue  # rows outside the window need not be valid: setpoints are often NaN there
        columns["time"].append(now)
        for signal, column in columns_of.items():
            if signal != "time":
                columns[signal].append(_value(path, number, cells, column, names[signal]))
    try:
        recording = Recording(
            columns["time"],
            columns["reference"],
            columns["output"],
            columns.get("command"),
            source=path.name,
        )
    except RecordingError as error:
        where = "" if window is None else f" in the window {window} s"
        raise RecordingError(f"{path}{where}: {error}") from None
    if not recording.steps():
        raise RecordingError(
            f"{path}: the reference {reference!r} is {recording.reference[0]:g} throughout, "
            "so there is no step; choose another column or window"
        )
    return recording


def _ends(window: OpenRange | None) -> tuple[float, float]:
    """Ends of the window, open where None, widened by rounding of the last printed digit."""
    low, high = open_interval("window", window)
    start = low if math.isinf(low) else low - 1e-9 * max(1.0, abs(low))
    stop = high if math.isinf(high) else high + 1e-9 * max(1.0, abs(high))
    return start, stop


def _table(path: Path, delimiter: str | None) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    """The header, and the numbered lines below it."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise RecordingError(f"there is no file {path}") from None
    except IsADirectoryError:
        raise RecordingError(f"{path} is a folder: give a CSV file") from None
    except UnicodeDecodeError:
        raise RecordingError(f"{path} is not a text file: give a CSV file") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
    if "\0" in text:
        raise RecordingError(f"{path} is not a text file: give a CSV file")
    numbered = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise RecordingError(f"{path} is empty: a header line and samples are needed")
    if delimiter is None:
        delimiter = _delimiter(numbered[0][1])
    elif len(delimiter) != 1:
        raise RecordingError(f"the delimiter {delimiter!r} is not one character")
    try:
        rows = list(csv.reader((line for _, line in numbered), delimiter=delimiter, strict=True))
    except csv.Error as error:
        raise RecordingError(f"{path} is not a CSV file: {error}") from None
    header = [cell.strip() for cell in rows[0]]
    lines = ((number, row) for (number, _), row in zip(numbered[1:], rows[1:], strict=False))
    return header, lines


def _delimiter(header: str) -> str:
    try:
        return csv.Sniffer().sniff(header, delimiters=",;\t ").delimiter
    except csv.Error:
        return ","


def _column_of(path: Path, header: list[str], signal: str, name: str) -> int:
    """Index of a column, by its name."""
    count = header.count(name)
    if count == 1:
        return header.index(name)
    if count > 1:
        raise RecordingError(f"{path} has {count} columns named {name!r}: rename all but one")
    similar = difflib.get_close_matches(name, header, n=1)
    hint = f"; did you mean {similar[0]!r}?" if similar else ""
    shown = ", ".join(repr(cell) for cell in header[:12]) + (", …" if len(header) > 12 else "")
    raise RecordingError(f"{path} has no column {name!r} for the {signal}: it has {shown}{hint}")


def _check_width(path: Path, number: int, cells: list[str], width: int) -> None:
    if any(cell.strip() for cell in cells[width:]):
        raise RecordingError(
            f"{path}, line {number}: {len(cells)} cells under {width} column names; if commas "
            "stand for decimal points, write points"
        )


def _value(path: Path, number: int, cells: list[str], column: int, name: str) -> float:
    if column >= len(cells):
        raise RecordingError(
            f"{path}, line {number}: {len(cells)} cells, so the column {name!r} has none"
        )
    cell = cells[column]
    try:
        if "_" in cell:  # float() would read 1_000 as 1000
            raise ValueError
        value = float(cell)
    except ValueError:
        hint = ""
        if DECIMAL_COMMA.fullmatch(cell.strip()):
            hint = ": write a decimal point instead of the comma"
        raise RecordingError(
            f"{path}, line {number}: {cell!r} in column {name!r} is not a number{hint}"
        ) from None
    if not math.isfinite(value):
        raise RecordingError(
            f"{path}, line {number}: {name!r} is {value}; leave the row out, or read a window "
            "without it"
        )
    return value
