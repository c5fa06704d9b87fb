"""Columns that are made when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from deadtime._base.arrays import Array


class Columns(Mapping[str, Array]):
    """Columns by their names, each made by a function.

    A log holds many columns of which few are used, in numbers of few bytes: as 64-bit numbers, all
    of them together would take more memory than a long log has.
    """

    def __init__(self, makers: Mapping[str, Callable[[], Array]]) -> None:
        self._makers = makers

    def __getitem__(self, name: str) -> Array:
        return self._makers[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)
