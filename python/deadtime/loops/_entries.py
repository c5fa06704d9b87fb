"""Vectors and matrices whose entries are numbers, or the numbers of many loops.

The equations of a loop are written down once. With `Each` in the place of its numbers they give the
entries of the matrices of many loops; with complex numbers, slopes by the complex step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray


class Each:
    """One number for each of many loops, which counts as a single number in a matrix.

    Zero and one, of which matrices are full, cost nothing.

    Parameters
    ----------
    numbers : ndarray, shape (n,)
    """

    __slots__ = ("numbers",)

    def __init__(self, numbers: NDArray[np.float64]) -> None:
        self.numbers = numbers

    def _with(self, other: Any, operation: Callable[..., Any]) -> Any:
        if isinstance(other, np.ndarray):
            # An array of entries, each of which meets these numbers.
            return NotImplemented
        return Each(operation(self.numbers, other.numbers if isinstance(other, Each) else other))

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self._with(other, np.add)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self._with(other, np.subtract)

    def __rsub__(self, other: Any) -> Any:
        return -self if _is(other, 0.0) else self._with(other, lambda mine, its: its - mine)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return 0.0
        return self if _is(other, 1.0) else self._with(other, np.multiply)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1.0) else self._with(other, np.divide)

    def __rtruediv__(self, other: Any) -> Any:
        return self._with(other, lambda mine, its: its / mine)

    def __neg__(self) -> Each:
        return Each(-self.numbers)

    def __ne__(self, other: object) -> bool:
        """Whether it is other than a number in any loop."""
        return bool(np.any(self.numbers != other))

    def __eq__(self, other: object) -> bool:
        return not self != other

    __hash__ = None  # type: ignore[assignment]


def _is(other: Any, number: float) -> bool:
    return isinstance(other, (int, float)) and other == number


#: Descending coefficients: numbers, arrays of numbers or symbols.
Polynomial: TypeAlias = list[Any]

#: Of a part without states.
_NO_VECTOR = np.empty(0)
_NO_MATRIX = np.empty((0, 0))
_FLOAT = np.dtype(np.float64)


def vector(entries: Sequence[Any]) -> NDArray[Any]:
    """Array of the entries."""
    if not entries:
        return _NO_VECTOR
    if Each in map(type, entries):
        # NumPy would ask each of these whether it is an array.
        array = np.empty(len(entries), dtype=object)
        for place, entry in enumerate(entries):
            array[place] = entry
        return array
    array = np.array(entries)
    if array.dtype is _FLOAT or array.dtype.kind in "cO":
        return array
    return array.astype(np.float64)


def matrix(rows: Sequence[Sequence[Any]]) -> NDArray[Any]:
    """Array of shape (m, n) from m rows of n entries."""
    if not rows:
        return _NO_MATRIX
    return vector([entry for row in rows for entry in row]).reshape(len(rows), -1)


def zeros(shape: tuple[int, ...], *like: NDArray[Any]) -> NDArray[Any]:
    """Zeros of the type of what is to be put among them."""
    return np.full(shape, 0.0, dtype=np.result_type(np.float64, *like))


def number(value: Any) -> Any:
    """Return a plain float where `value` is one real number."""
    if type(value) is float:
        return value
    return value if isinstance(value, Each) or np.iscomplexobj(value) else float(value)


def multiplied(p: Polynomial, q: Polynomial) -> Polynomial:
    """Product of two polynomials."""
    out: Polynomial = [0.0] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            out[i + j] = out[i + j] + a * b
    return out
