"""Addresses of the columns in a MAT file, alike for all versions.

``t`` is a vector, ``rates[1]`` the second signal of a matrix; the longer axis of a matrix is time.
``log.signals.values`` is a field of a structure, ``log.signals[1].values`` that of its second
element.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import RecordingError

#: Largest number of columns that a file may have, and deepest nesting of structures.
COLUMNS, DEPTH = 100_000, 16


def signal_names(name: str, shape: tuple[int, ...]) -> list[str]:
    """Addresses of the signals of an array, without any for a number or for more dimensions."""
    sides = [side for side in shape if side != 1]
    if len(sides) == 1:
        return [name]
    if len(sides) != 2:
        return []
    check_columns(name, min(sides))
    return [f"{name}[{i}]" for i in range(min(sides))]


def signals(array: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """The signals of an array with the axes of MATLAB: of a square one its columns."""
    matrix = np.squeeze(array)
    if matrix.ndim == 1:
        yield matrix
    else:
        yield from matrix if matrix.shape[0] < matrix.shape[1] else matrix.T


def check_columns(what: object, count: int) -> None:
    """Refuse too many columns."""
    if count > COLUMNS:
        raise RecordingError(
            f"{what} has more than {COLUMNS} columns: save only the columns that are needed"
        )


def with_objects(path: object, has_objects: bool) -> str:
    """What messages call a file, with a remark if it has objects."""
    return (
        (f"{path} (a timeseries and other objects in it cannot be read)")
        if has_objects
        else str(path)
    )
