"""`read_recording`: a recording from a table in a file or in memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import RecordingError
from deadtime._base.validation import OpenRange, Range, open_interval
from deadtime.recordings._first_bytes import HEAD, format_of, opened, whole
from deadtime.recordings._recording import Recording
from deadtime.recordings.readers._arrow import arrow_file
from deadtime.recordings.readers._columns import Signals, Table, read_table, widened
from deadtime.recordings.readers._csv import read_csv
from deadtime.recordings.readers._mat import mat_file
from deadtime.recordings.readers._mat73 import mat73_file
from deadtime.recordings.readers._tables import LABEL, table_in_memory
from deadtime.recordings.readers._text import Text, as_text, not_text
from deadtime.recordings.readers._usual import chosen_columns, second_in

#: Latest time in s, the year 5138 if it counts from 1970: later ones are of a smaller unit.
LATEST = 1e11

#: From the label of a table and the names of its columns to the name for each signal.
Choice: TypeAlias = Callable[[object, Sequence[str]], dict[str, str]]


def read_recording(
    source: str | os.PathLike[str] | Any,
    *,
    time: str | None = None,
    reference: str | None = None,
    output: str | None = None,
    command: str | None = None,
    window: OpenRange | None = None,
    delimiter: str | None = None,
) -> Recording:
    r"""Read a recording from a table, in a file or in memory.

    Parameters
    ----------
    source : path-like or table
        A file of text (CSV), plain or packed by gzip; of Parquet, Arrow or Feather; or of MATLAB,
        version 5 or 7.3. The first bytes tell the format, not the name. Or a table in memory: a
        DataFrame of pandas or polars, an Arrow table, a dict of arrays, an `xarray.Dataset`, or a
        structured array.
    time, reference, output : str, optional
        Names of the columns that hold the time stamps, the reference and the measurement. Times are
        in seconds, unless the name ends in another unit: time_ms, t_us, Time (min). If names
        are not given, they are found by usual names: time, t, Time (s), Timestamp; reference,
        SP, setpoint; output, PV, y; and so on. The reference may be missing where there is a
        command.
    command : str, optional
        Name of the column that holds the command sent to the plant; ``"auto"`` for one of a usual
        name: command, OP, MV, u. If it is not given, a command is read where there is no reference.
    window : (low, high), optional
        Keep only the rows between these times, s; None leaves an end open.
    delimiter : str, optional
        Separator of the columns of a text, a space for any number of blanks. If it is not given,
        it is the one of comma, semicolon, tab and space under which the header has the names.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError
        When the file cannot be read, is of no such format, lacks a column, holds a value that is
        no number or infinite, a time that goes back or repeats in more than 1 % of the rows, too
        few samples, or neither a command nor a reference that changes.
        The message names the line of a text, or the row of another table, counted from 0. The log
        of an autopilot is refused by the name of its format.
    MissingExtraError
        When the library that reads the format is not installed.
    TypeError
        When `source` is neither a path nor a table.

    Notes
    -----
    A text has one line of column names, then one line a sample. Lines that begin with ``#`` and
    empty lines are skipped. A comma is read as a decimal point where columns are separated by
    another character, or the cell is quoted, if no cell has a point; ``1,234`` only if another
    cell cannot be a thousand. The text is in UTF-8, UTF-16 with a mark, or Latin-1.

    In a MAT file, ``"t"`` is a vector, ``"rates[1]"`` the second signal of a matrix, whose longer
    axis is time, ``"log.signals.values[2]"`` one of a structure, as Simulink writes it, and
    ``"log.signals[1].values"`` one of the second element of an array of structures.

    Dates (in a text as ISO 8601 writes them) become seconds after the first of them, durations
    seconds. The index of a pandas DataFrame is a column if it has a name. Missing values (an empty
    cell, null, NaN, a masked entry) are missing rows, as `Recording` has them. A row with the time
    of the next one is placed before it.

    Examples
    --------
    >>> import deadtime as dtm, pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> rows = [f"{k / 10},{int(k > 4)},{max(0, k - 6) / 10}" for k in range(20)]
    >>> _ = file.write_text("t_s,ref_m,height_m\n" + "\n".join(rows))
    >>> recording = dtm.read_recording(file, time="t_s", reference="ref_m", output="height_m")
    >>> len(recording), recording.steps()[0].time
    (20, 0.5)
    >>> table = {"t": recording.time, "r": recording.reference, "y": recording.output}
    >>> dtm.read_recording(table, time="t", reference="r", output="y", window=(0.2, 1.5))
    <Recording: 14 samples, 0.2 to 1.5 s, reference, output>
    """
    given = {"time": time, "reference": reference, "output": output}
    optional = set() if command is None else {"reference"}
    if command is not None:
        given["command"] = None if command == "auto" else command
    choose = partial(chosen_columns, given=given, optional=optional)
    ends = widened(*open_interval("window", window))
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        label, own = str(path), path.name
        columns = _from_file(
            path, {name for name in given.values() if name}, choose, ends, delimiter
        )
    else:
        label, own = LABEL, ""
        if delimiter is not None:
            raise ValueError(
                f"delimiter={delimiter!r}: a table in memory has no delimiter. Leave delimiter out"
            )
        table = table_in_memory(source)
        columns = _in_seconds(read_table, table, choose(LABEL, table.names), ends)
    _refuse_other_units(label, columns["time"])
    try:
        recording = Recording(
            columns["time"],
            columns.get("reference"),
            columns["output"],
            columns.get("command"),
            source=own,
        )
    except RecordingError as error:
        where = "" if window is None else f" in the window {window} s"
        raise RecordingError(f"{label}{where}: {error}") from None
    if recording.command is None and not recording.steps():
        called = "reference" if reference is None else f"reference {reference!r}"
        raise RecordingError(
            f"{label}: the {called} is {recording.reference[0]:g} throughout, so there is no "
            "step. Choose another column or window, or name the column of the command"
        )
    return recording


def _in_seconds(
    read: Callable[[Any, dict[str, str], Range], Signals],
    table: Text | Table,
    names: dict[str, str],
    ends: Range,
) -> Signals:
    """The columns, the time in s where its name says another unit, such as `time_ms`."""
    time = names["time"]
    count = second_in(time)
    if isinstance(table, Table) and np.asarray(table.take(time)).dtype.kind in "mM":
        count = 1.0  # dates and durations know their unit
    columns = read(table, names, (ends[0] * count, ends[1] * count))
    if count != 1.0:
        columns["time"] = columns["time"] / count
    return columns


def _refuse_other_units(label: str, time: NDArray[np.float64]) -> None:
    """Refuse stamps that are milliseconds or shorter since 1970."""
    first = float(np.ma.getdata(time)[0]) if time.size else 0.0
    if first > LATEST:
        raise RecordingError(
            f"{label}: the time begins at {first:.6g}, which cannot be seconds since 1970. "
            "Divide milliseconds by 1000, or microseconds by a million"
        )


def _from_file(
    path: Path, named: set[str], choose: Choice, ends: Range, delimiter: str | None
) -> Signals:
    with opened(path) as stream:
        head = stream.read(HEAD)
        kind = format_of(path, head, "read_recording")
        if kind is None and b"\0" in head:  # not even in part: it may have no end
            raise not_text(path)
        if kind in (None, "text", "gzip"):
            text = as_text(path, whole(stream, head), named, delimiter)
            return _in_seconds(read_csv, text, choose(path, text.header), ends)
    if delimiter is not None:
        raise ValueError(
            f"delimiter={delimiter!r}: {path} is a file of {kind}, which has no delimiter. "
            "Leave delimiter out"
        )
    table = _table(path, kind, named)
    names = choose(path, table.names)
    if not named.issuperset(names.values()):
        table = _table(path, kind, set(names.values()))
    return _in_seconds(read_table, table, names, ends)


def _table(path: Path, kind: str, wanted: set[str]) -> Table:
    if kind == "MAT v5":
        return mat_file(path, wanted)
    return mat73_file(path, wanted) if kind == "MAT v7.3" else arrow_file(path, kind, wanted)
