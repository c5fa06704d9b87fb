"""Parquet and Arrow files, read by pyarrow."""

from __future__ import annotations

import os
from typing import Any

from deadtime._base.extras import library
from deadtime.recordings.readers._columns import Table
from deadtime.recordings.readers._limits import check_numbers, errors_of
from deadtime.recordings.readers._tables import frame

INSTALLS = "'deadtime[logs]'"


def arrow_file(path: str | os.PathLike[str], kind: str, wanted: set[str]) -> Table:
    """The table of a file, of which only the `wanted` columns are kept."""
    pyarrow = library("pyarrow", f"reading {kind} files", INSTALLS)
    with errors_of(path, kind), pyarrow.OSFile(os.fspath(path)) as stream:
        names, table = (_parquet if kind == "Parquet" else _ipc)(stream, path, kind, wanted)
        table.validate(full=True)  # of a damaged file, the rows of a column may lie elsewhere
    return Table(str(path), names, frame(str(path), table).take)


def _parquet(
    stream: Any, path: str | os.PathLike[str], kind: str, wanted: set[str]
) -> tuple[list[str], Any]:
    parquet = library("pyarrow.parquet", f"reading {kind} files", INSTALLS)
    with parquet.ParquetFile(stream) as file:
        names = file.schema_arrow.names
        columns = [name for name in names if name in wanted]
        check_numbers(path, os.path.getsize(path), file.metadata.num_rows * len(columns))
        return names, file.read(columns=columns)


def _ipc(
    stream: Any, path: str | os.PathLike[str], kind: str, wanted: set[str]
) -> tuple[list[str], Any]:
    ipc = library("pyarrow.ipc", f"reading {kind} files", INSTALLS)
    with (ipc.open_stream if kind == "Arrow stream" else ipc.open_file)(stream) as reader:
        names = reader.schema.names
        fields = [i for i, name in enumerate(names) if name in wanted]
        return names, reader.read_all().select(fields)


def parquet_metadata(path: str | os.PathLike[str]) -> dict[bytes, bytes]:
    """The metadata of a Parquet file, by their keys."""
    parquet = library("pyarrow.parquet", "reading Parquet files", INSTALLS)
    with errors_of(path, "Parquet"):
        return dict(parquet.read_schema(os.fspath(path)).metadata or {})
