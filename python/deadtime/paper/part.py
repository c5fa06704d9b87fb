"""What every part of the reproduction has: comparisons, and tables of what else it found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from deadtime.paper.comparison import Comparison

__all__ = ["Grid", "Part"]


@dataclass(frozen=True)
class Grid:
    """A table in words, for a terminal or a page.

    Attributes
    ----------
    title : str
        What it shows.
    heads : tuple of str
        Its columns.
    rows : tuple of tuple of str
        Its cells.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


class Part(Protocol):
    """A table or a figure of the paper, reproduced.

    Attributes
    ----------
    comparisons : tuple of Comparison
        The numbers printed there beside ours.
    """

    @property
    def comparisons(self) -> tuple[Comparison, ...]:
        """The numbers printed there beside ours."""
        ...

    def grids(self) -> tuple[Grid, ...]:
        """Further tables: what the numbers alone do not say."""
        ...

    def findings(self) -> tuple[str, ...]:
        """What came out, in sentences."""
        ...
