"""The tables of several estimates of one delay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from rich.table import Table

from deadtime._base.printable import printable
from deadtime.estimation import (
    COLUMNS,
    PLANT_COLUMNS,
    Comparison,
    PlantChoice,
    truth_row,
)


def estimates_table(comparison: Comparison, truth: Mapping[str, float] | None = None) -> Table:
    """The delay by every method, with the truth beside it where it is known."""
    table = _table("Delay of the loop", COLUMNS, comparison.rows(), (COLUMNS[0], COLUMNS[-1]))
    if truth is not None:
        table.add_section()
        table.add_row(*truth_row(truth), style="bold")
    return table


def choice_table(choice: PlantChoice) -> Table:
    """The plants that were tried, the likeliest first."""
    return _table("Plants", PLANT_COLUMNS, choice.rows(), PLANT_COLUMNS[:1])


def _table(
    title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], left: Sequence[str]
) -> Table:
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    for head in heads:
        table.add_column(head, justify="left" if head in left else "right", no_wrap=True)
    for row in rows:
        # A reason does not fit into a cell; it is said in full below the table.
        table.add_row(*map(printable, row if len(row) > 2 else [row[0], "refused"]))
    return table
