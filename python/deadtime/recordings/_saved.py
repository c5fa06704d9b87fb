"""Recordings in files of our own, and as tables of other packages.

A CSV file begins with two lines of comment, the second with source and units in JSON. Then come the
header and the rows, each number with the fewest digits that give the same double:

    # deadtime recording
    # {"source": "step of 1", "units": {"output": "m"}}
    time,reference,output
    0.0,0.0,0.012

A Parquet file has the same columns, and the same JSON in its metadata under ``deadtime``. Commands
with times of their own are in the JSON, as ``{"sent": [times, values]}``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import RecordingError
from deadtime._base.extras import library
from deadtime.recordings._first_bytes import HEAD, format_of, opened, whole
from deadtime.recordings.readers._arrow import INSTALLS, arrow_file, parquet_metadata
from deadtime.recordings.readers._columns import read_table
from deadtime.recordings.readers._csv import read_csv
from deadtime.recordings.readers._text import as_text

Columns = Mapping[str, NDArray[np.float64]]

#: First line of a CSV file.
TITLE = "# deadtime recording"

#: The columns, of which the last may be missing.
NAMES = ("time", "reference", "output", "command")

EVER = (-np.inf, np.inf)


def save_table(
    path: str | os.PathLike[str],
    columns: Columns,
    units: Mapping[str, str],
    source: str,
    sent: Sequence[NDArray[np.float64]] | None = None,
) -> None:
    """Write columns, units, source and commands sent as the suffix of the path says."""
    file = Path(path)
    commands = {} if sent is None else {"sent": [part.tolist() for part in sent]}
    described = json.dumps({"source": source, "units": dict(units), **commands})
    if file.suffix == ".csv":
        rows = zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True)
        with file.open("w", encoding="utf-8", newline="\n") as stream:
            stream.write(f"{TITLE}\n# {described}\n{','.join(columns)}\n")
            stream.writelines(",".join(row) + "\n" for row in rows)
    elif file.suffix == ".parquet":
        pyarrow = library("pyarrow", "writing Parquet files", INSTALLS)
        parquet = library("pyarrow.parquet", "writing Parquet files", INSTALLS)
        table = pyarrow.table(dict(columns)).replace_schema_metadata({"deadtime": described})
        parquet.write_table(table, os.fspath(file))
    else:
        raise ValueError(f"{file} ends in {file.suffix!r}: give a path ending in .csv or .parquet")


def load_table(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Columns, units and source of a saved recording, as the arguments of `Recording`."""
    with opened(path) as stream:
        head = stream.read(HEAD)
        if format_of(path, head, "read_recording") == "Parquet":
            described = parquet_metadata(path).get(b"deadtime", b"")
            table = arrow_file(path, "Parquet", set(NAMES))
            fields = _described(path, described)
            return read_table(table, _signals(table.names), EVER) | fields
        text = as_text(path, whole(stream, head), NAMES, ",")
    title, comment, *_ = (*text.comments, "", "")
    described = comment[1:].encode() if title == TITLE else b""
    fields = _described(path, described)
    return read_csv(text, _signals(text.header), EVER) | fields


def _signals(names: Iterable[str]) -> dict[str, str]:
    return {name: name for name in NAMES if name != "command" or name in names}


def _described(path: object, text: bytes) -> dict[str, Any]:
    try:
        fields = json.loads(text)
        source, units = fields["source"], fields["units"]
        if not isinstance(source, str) or not all(isinstance(unit, str) for unit in units.values()):
            raise TypeError
        if "sent" in fields:
            times, values = fields["sent"]
            return {"source": source, "units": units, "command": None, "sent": (times, values)}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise RecordingError(
            f"{path} was not written by Recording.save. Read this file with dtm.read_recording, "
            "and give the names of its columns"
        ) from None
    return {"source": source, "units": units}


def as_frame(columns: Columns, units: Mapping[str, str], source: str) -> Any:
    """A DataFrame of pandas."""
    pandas = library("pandas", "to_dataframe()", "pandas")
    frame = pandas.DataFrame(dict(columns))
    frame.attrs.update(source=source, units=dict(units))
    return frame


def as_dataset(columns: Columns, units: Mapping[str, str], source: str) -> Any:
    """A Dataset of xarray."""
    xarray = library("xarray", "to_xarray()", "xarray")
    variables = {
        name: ("time", column.copy(), {"units": units[name]} if name in units else {})
        for name, column in columns.items()
    }
    return xarray.Dataset(variables, attrs={"source": source})
