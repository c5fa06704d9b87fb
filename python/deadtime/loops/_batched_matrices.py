"""Vectors and matrices whose entries are numbers, or arrays of numbers: one matrix an element.

The equations of a loop are written down once. With arrays in the place of its numbers they give
the matrices of many loops, in the leading axes; with complex numbers, slopes by the complex step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def vector(entries: Sequence[Any]) -> NDArray[Any]:
    """Array of shape (..., n) from n entries that broadcast against one another."""
    if any(isinstance(entry, np.ndarray) for entry in entries):
        return np.stack(np.broadcast_arrays(*entries), axis=-1)
    return np.array(entries, dtype=np.result_type(np.float64, *(type(e) for e in entries)))


def matrix(rows: Sequence[Sequence[Any]]) -> NDArray[Any]:
    """Array of shape (..., m, n) from m rows of n entries."""
    flat = vector([entry for row in rows for entry in row])
    return flat.reshape(*flat.shape[:-1], len(rows), -1 if rows else 0)


def zeros(shape: tuple[int, ...], *like: Any) -> NDArray[Any]:
    """Zeros of `shape` behind the leading axes, and of the type, of what is to be put in them."""
    leading = np.broadcast_shapes(*(np.shape(part)[: np.ndim(part) - len(shape)] for part in like))
    return np.zeros(leading + shape, dtype=np.result_type(np.float64, *like))


def column(factor: Any) -> Any:
    """Bring a number an element in a shape that multiplies a vector an element."""
    return factor[..., None] if isinstance(factor, np.ndarray) else factor


def number(value: Any) -> Any:
    """Return a plain float where `value` is one real number."""
    return float(value) if np.ndim(value) == 0 and not np.iscomplexobj(value) else value
