"""MAT files of version 7.3, which are HDF5 files, read by h5py.

MATLAB stores an array by columns, so that its axes stand in reverse. A field of an array of
structures is an array of references to its elements.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

from numpy.typing import NDArray

from deadtime._base.extras import library
from deadtime.recordings.readers._columns import Table
from deadtime.recordings.readers._limits import check_numbers, errors_of
from deadtime.recordings.readers._mat_addresses import (
    DEPTH,
    check_columns,
    signal_names,
    signals,
    with_objects,
)


def mat73_file(path: str | os.PathLike[str], wanted: set[str]) -> Table:
    """The table of a file, of which only the arrays with `wanted` addresses are loaded."""
    h5py = library("h5py", "reading MAT v7.3 files", "'deadtime[logs]'")
    names: list[str] = []
    loaded: dict[str, NDArray[Any]] = {}
    with errors_of(path, "MAT v7.3"), h5py.File(path, "r") as file:
        for name, array in _arrays(h5py, file, file, ""):
            own = signal_names(name, array.shape)
            names += own
            check_columns(path, len(names))
            if not wanted.isdisjoint(own):
                check_numbers(path, os.path.getsize(path), array.size)
                loaded.update(zip(own, signals(array[()].T), strict=True))
        label = with_objects(path, "#subsystem#" in file)
    return Table(label, names, loaded.__getitem__)


def _arrays(h5py: Any, file: Any, node: Any, name: str, depth: int = 0) -> Iterator[Any]:
    """The arrays of numbers below a node, each with its address."""
    if depth > DEPTH:
        return
    if isinstance(node, h5py.Dataset):
        if node.dtype.kind in "biuf" and node.attrs.get("MATLAB_class") != b"char":
            yield name, node
        return
    for field in node:
        if field.startswith("#") or not isinstance(node.get(field, getlink=True), h5py.HardLink):
            continue
        child = node[field]
        if getattr(child, "dtype", None) == h5py.ref_dtype:
            if "MATLAB_class" in child.attrs or not name:
                continue  # a cell array
            check_columns(file.filename, child.size)
            for i, reference in enumerate(child[()].ravel()):
                yield from _arrays(h5py, file, file[reference], f"{name}[{i}].{field}", depth + 1)
        else:
            yield from _arrays(h5py, file, child, f"{name}.{field}".lstrip("."), depth + 1)
