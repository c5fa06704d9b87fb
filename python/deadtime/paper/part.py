"""The protocol of a part of the reproduction: comparisons and further tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from deadtime.paper.comparison import Comparison

__all__ = ["Grid", "Part"]


@dataclass(frozen=True)
class Grid:
    """A table of text, for a terminal or a page.

    Attributes
    ----------
    title : str
        Title.
    heads : tuple of str
        Headings of the columns.
    rows : tuple of tuple of str
        Cells.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


class Part(Protocol):
    """A table or a figure of the paper, reproduced.

    Attributes
    ----------
    comparisons : tuple of Comparison
        The printed numbers beside the computed ones.
    """

    @property
    def comparisons(self) -> tuple[Comparison, ...]:
        """The printed numbers beside the computed ones."""
        ...

    def grids(self) -> tuple[Grid, ...]:
        """Further tables."""
        ...

    def findings(self) -> tuple[str, ...]:
        """The findings, in sentences."""
        ...
