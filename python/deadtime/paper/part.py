"""The protocol of a part of the reproduction: comparisons and further tables."""

from __future__ import annotations

from dataclasses import dataclass, field

from deadtime.paper.comparison import Comparison


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


@dataclass(frozen=True, eq=False)
class Part:
    """A table or a figure of the paper, reproduced.

    Attributes
    ----------
    comparisons : tuple of Comparison
        The printed numbers beside the computed ones.
    """

    comparisons: tuple[Comparison, ...] = field(default=(), kw_only=True)

    def grids(self) -> tuple[Grid, ...]:
        """Further tables."""
        return ()

    def findings(self) -> tuple[str, ...]:
        """The findings, in sentences."""
        return ()
