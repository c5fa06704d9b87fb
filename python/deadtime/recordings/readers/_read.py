"""`read_recording`: a recording from a table in a file or in memory."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from deadtime._base.errors import RecordingError
from deadtime._base.validation import OpenRange, Range, open_interval
from deadtime.recordings._first_bytes import HEAD, format_of, opened, whole
from deadtime.recordings._recording import Recording
from deadtime.recordings.readers._arrow import arrow_file
from deadtime.recordings.readers._columns import Signals, read_table, widened
from deadtime.recordings.readers._csv import read_csv
from deadtime.recordings.readers._mat import mat_file
from deadtime.recordings.readers._mat73 import mat73_file
from deadtime.recordings.readers._tables import LABEL, table_in_memory
from deadtime.recordings.readers._text import as_text, not_text


def read_recording(
    source: str | os.PathLike[str] | Any,
    *,
    time: str = "time",
    reference: str = "reference",
    output: str = "output",
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
    time, reference, output : str
        Names of the columns that hold the time stamps (s), the reference and the measurement.
    command : str, optional
        Name of the column that holds the command sent to the plant.
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
        no finite number, a time that does not increase, a constant reference, or too few samples.
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

    Dates become seconds after the first of them, durations seconds. The index of a pandas
    DataFrame is a column if it has a name. Missing values (null, a masked entry) are rows left out,
    as `Recording` leaves out masked rows; NaN is refused inside the window.

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
    names = {"time": time, "reference": reference, "output": output}
    if command is not None:
        names["command"] = command
    ends = widened(*open_interval("window", window))
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        label, own = str(path), path.name
        columns = _from_file(path, names, ends, delimiter)
    else:
        label, own = LABEL, ""
        if delimiter is not None:
            raise ValueError(f"delimiter={delimiter!r}: a table in memory has none; leave it out")
        columns = read_table(table_in_memory(source), names, ends)
    try:
        recording = Recording(
            columns["time"],
            columns["reference"],
            columns["output"],
            columns.get("command"),
            source=own,
        )
    except RecordingError as error:
        where = "" if window is None else f" in the window {window} s"
        raise RecordingError(f"{label}{where}: {error}") from None
    if not recording.steps():
        raise RecordingError(
            f"{label}: the reference {reference!r} is {recording.reference[0]:g} throughout, "
            "so there is no step; choose another column or window"
        )
    return recording


def _from_file(path: Path, names: dict[str, str], ends: Range, delimiter: str | None) -> Signals:
    wanted = set(names.values())
    with opened(path) as stream:
        head = stream.read(HEAD)
        kind = format_of(path, head, "read_recording")
        if kind is None and b"\0" in head:  # not even in part: it may have no end
            raise not_text(path)
        if kind in (None, "text", "gzip"):
            return read_csv(as_text(path, whole(stream, head), wanted, delimiter), names, ends)
    if delimiter is not None:
        raise ValueError(f"delimiter={delimiter!r}: {path} is a file of {kind}, which has none")
    if kind == "MAT v5":
        table = mat_file(path, wanted)
    elif kind == "MAT v7.3":
        table = mat73_file(path, wanted)
    else:
        table = arrow_file(path, kind, wanted)
    return read_table(table, names, ends)
