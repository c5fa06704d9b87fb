"""Tables in memory: DataFrames, dicts of arrays, structured arrays, Datasets, Arrow tables.

None of their libraries is imported: a column is asked for what it can do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from deadtime._base.extras import library
from deadtime.recordings.readers._columns import Table
from deadtime.recordings.readers._limits import errors_of

LABEL = "the table"


def table_in_memory(source: Any) -> Table:
    """The table of an object, or a TypeError."""
    if isinstance(source, np.ndarray) and source.dtype.names:
        return Table(LABEL, source.dtype.names, source.__getitem__)
    if hasattr(source, "data_vars"):  # an xarray.Dataset, which is a mapping as well
        return _named(LABEL, source, source.variables, lambda column: column.to_numpy())
    if isinstance(source, Mapping):
        return _named(LABEL, source, source, lambda column: column)
    if hasattr(source, "collect"):  # a polars.LazyFrame
        source = source.collect()
    if hasattr(source, "columns") and hasattr(source, "__getitem__"):
        return frame(LABEL, source)
    if hasattr(source, "__arrow_c_stream__"):
        pyarrow = library("pyarrow", "reading Arrow streams", "'deadtime[logs]'")
        with errors_of(LABEL, "an Arrow stream"):
            return frame(LABEL, pyarrow.table(source))
    raise TypeError(
        f"a {type(source).__name__} is not a table: give a path, a DataFrame, a dict of "
        "arrays, a structured array or an xarray.Dataset"
    )


def frame(label: str, source: Any) -> Table:
    """The table of a DataFrame of pandas or polars, or of an Arrow table."""
    if hasattr(source, "reset_index"):  # the index of pandas is a column if it has a name
        own = [name for name in source.index.names if name is not None]
        source = source.reset_index([name for name in own if name not in source.columns])
    names = source.column_names if hasattr(source, "column_names") else source.columns
    return _named(label, source, names, _values)


def _named(label: str, source: Any, names: Any, values: Any) -> Table:
    """A table whose columns are `source[name]`."""
    keys = {str(name): name for name in names}
    return Table(label, [str(name) for name in names], lambda name: values(source[keys[name]]))


def _values(column: Any) -> Any:
    """Values of a column, masked where they are missing; NaN is a value where both can be."""
    if not hasattr(column, "isna"):  # polars and pyarrow
        values, missing = np.asarray(column), np.asarray(column.is_null())
    elif isinstance(column.dtype, np.dtype):
        return column.to_numpy()
    else:
        missing = column.isna().to_numpy()
        kind = column.dtype.kind
        if kind == "M":
            values = column.to_numpy("M8[ns]")
        elif kind in "biuf":
            values = column.to_numpy(float, na_value=np.nan)
        else:
            values = column.to_numpy()
    return np.ma.array(values, mask=missing) if missing.any() else values
