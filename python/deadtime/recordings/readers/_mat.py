"""MAT files of version 5, read by scipy, and their addresses, which version 7.3 has as well.

``t`` is a vector, ``rates[1]`` the second signal of a matrix; the longer axis of a matrix is time.
``log.signals.values`` is a field of a structure, ``log.signals[1].values`` that of its second
element.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import RecordingError
from deadtime.recordings.readers._columns import Table
from deadtime.recordings.readers._limits import errors_of

#: Largest number of addresses that a file may have.
ADDRESSES = 100_000

#: Deepest nesting of structures.
DEPTH = 16


def mat_file(path: str | os.PathLike[str], wanted: set[str]) -> Table:
    """The table of a file, of which only the variables of `wanted` addresses are loaded."""
    from scipy.io import loadmat, whosmat

    with errors_of(path, "MAT v5"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of variables that are not wanted
        variables = {name: kind for name, _, kind in whosmat(path)}
        first = {re.split(r"[.\[]", name)[0] for name in wanted}
        loaded = loadmat(path, variable_names=[*first] if first <= variables.keys() else None)
        columns: dict[str, NDArray[Any]] = {}
        for name in variables:
            for address, column in _columns(name, loaded.get(name)):
                columns[address] = column
                check_addresses(path, len(columns))
        label = with_objects(path, not {"opaque", "object"}.isdisjoint(variables.values()))
    return Table(label, [*columns], columns.__getitem__)


def _columns(name: str, value: Any, depth: int = 0) -> Iterator[tuple[str, NDArray[Any]]]:
    """The columns in a variable, each with its address."""
    if not isinstance(value, np.ndarray) or depth > DEPTH:
        return
    if value.dtype.names:
        for i, one in enumerate(value.ravel(order="F")):
            element = f"{name}[{i}]" if value.size > 1 else name
            for field in value.dtype.names:
                yield from _columns(f"{element}.{field}", one[field], depth + 1)
    elif value.dtype.kind in "biufc":
        yield from signals_of(name, np.squeeze(value))


def signals_of(name: str, matrix: Any) -> Iterator[tuple[str, Any]]:
    """The signals of a matrix, or the vector itself."""
    if matrix.ndim == 1:
        yield name, matrix
    elif matrix.ndim == 2:
        signals = matrix if matrix.shape[0] < matrix.shape[1] else matrix.T
        yield from ((f"{name}[{i}]", signal) for i, signal in enumerate(signals))


def check_addresses(path: object, count: int) -> None:
    """Refuse a file with too many columns."""
    if count > ADDRESSES:
        raise RecordingError(f"{path} has more than {ADDRESSES} columns: save the ones you need")


def with_objects(path: object, has_objects: bool) -> str:
    """What messages call a file, with a remark if it has objects."""
    return f"{path} (timeseries and other objects in it are left out)" if has_objects else str(path)
