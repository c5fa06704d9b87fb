"""Columns that are made when they are asked for, and the bytes that they are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array


def gathered(
    content: NDArray[np.uint8], places: NDArray[np.int64], count: int
) -> NDArray[np.uint8]:
    """So many bytes from each of these places, shape (places, count)."""
    found = np.empty((places.size, count), dtype=np.uint8)
    for k in range(count):
        np.take(content, places + k, out=found[:, k])
    return found


class Columns(Mapping[str, Array]):
    """Columns by their names, each made by a function.

    A log holds many columns of which few are used, in numbers of few bytes: as 64-bit numbers, all
    of them together would take more memory than a long log has.
    """

    def __init__(self, makers: Mapping[str, Callable[[], Array]]) -> None:
        self._makers = makers

    def __getitem__(self, name: str) -> Array:
        return self._makers[name]()

    def __contains__(self, name: object) -> bool:
        return name in self._makers

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)
