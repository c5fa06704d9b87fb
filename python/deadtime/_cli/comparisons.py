"""The tables of several estimates of one delay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from rich.table import Table

from deadtime.estimation import (
    COLUMNS,
    COLUMNS as PLANT_COLUMNS,
    Comparison,
    PlantChoice,
    truth_row,
)


def estimates_table(comparison: Comparison, truth: Mapping[str, float] | None = None) -> Table:
    """The delay by every method, with the truth beside it where it is known."""
    table = Table(title="Delay of the loop", title_justify="left", box=None, padding=(0, 1, 0, 0))
    for index, head in enumerate(COLUMNS):
        justify: Literal["left", "right"] = "right" if 0 < index < len(COLUMNS) - 1 else "left"
        table.add_column(head, justify=justify, no_wrap=True)
    for row in comparison.rows():
        # A reason does not fit into a cell; it is said in full below the table.
        table.add_row(*(row if len(row) > 2 else [row[0], "refused"]))
    if truth is not None:
        table.add_section()
        table.add_row(*truth_row(truth), style="bold")
    return table


def choice_table(choice: PlantChoice) -> Table:
    """The plants that were tried, the likeliest first."""
    table = Table(title="Plants", title_justify="left", box=None, padding=(0, 1, 0, 0))
    for index, head in enumerate(PLANT_COLUMNS):
        table.add_column(head, justify="right" if index else "left", no_wrap=True)
    for row in choice.rows():
        table.add_row(*(row if len(row) > 2 else [row[0], "refused"]))
    return table
