"""The command that reproduces the paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer
from rich import box
from rich.table import Table

from deadtime._base.drawing import check_matplotlib
from deadtime._cli import options as opt
from deadtime._cli.show import console, print_json, print_table, save_figure, stages
from deadtime.paper import PARTS, TITLES, Grid, Part, Verdict, reproduce
from deadtime.paper._page import write_reproduction

__all__ = ["reproduce_paper"]

STYLES = {
    Verdict.EXACT: "green",
    Verdict.CONFIRMED: "green",
    Verdict.PARTLY: "yellow",
    Verdict.DIFFERENT: "bold red",
    Verdict.CONTRADICTED: "bold red",
    Verdict.MEASURED: "dim",
}

#: Verdicts that need no further word in a terminal.
SETTLED = (Verdict.EXACT, Verdict.MEASURED)


def reproduce_paper(
    out: Annotated[Path, typer.Option(help="Folder for the figures and the page.")] = Path(
        "reproduction"
    ),
    page: Annotated[
        Path | None, typer.Option(help="The page. Without: reproduction.html in the folder.")
    ] = None,
    only: Annotated[
        str | None, typer.Option(help=f"Parts, between commas, of {', '.join(PARTS)}.")
    ] = None,
    pictures: Annotated[
        Literal["png", "svg", "pdf"], typer.Option(help="Format of the figures.")
    ] = "png",
    as_json: opt.As_json = False,
) -> None:
    """Reproduce the paper on delays in quadrotor control: each printed number beside ours."""
    check_matplotlib()
    names = None if only is None else [name.strip() for name in only.split(",") if name.strip()]
    count = len(PARTS) if names is None else len(set(names))
    with stages(count + 1, quiet=as_json) as begin:
        found = reproduce(names, progress=begin)
        begin("drawing")
        figures = found.figures()
        out.mkdir(parents=True, exist_ok=True)
        files = {name: out / f"{name}.{pictures}" for name in figures}
        for name, figure in figures.items():
            save_figure(figure, files[name])
        written = write_reproduction(found, page or out / "reproduction.html", figures)
    if as_json:
        print_json({**found.to_dict(), "figures": files, "page": written})
        return
    for name, part in found.parts.items():
        _show(TITLES[name], part)
    console.print(found.summary(), highlight=False, markup=False, style="bold")
    console.print(f"figures: {out}, page: {written}", highlight=False, markup=False)


def _show(title: str, part: Part) -> None:
    console.print(title, highlight=False, markup=False, style="bold")
    if part.comparisons:
        table = Table(box=box.SIMPLE_HEAD)
        for head in ("where", "what", "printed", "ours", "verdict"):
            table.add_column(head, justify="right" if head in ("printed", "ours") else "left")
        for one in part.comparisons:
            verdict = f"[{STYLES[one.verdict]}]{one.outcome}[/]"
            table.add_row(one.where, one.quantity, one.printed, one.shown, verdict)
        print_table(table)
    for grid in part.grids():
        print_table(_table(grid))
    unsettled = [one for one in part.comparisons if one.note and one.verdict not in SETTLED]
    for one in unsettled:
        console.print(f"• {one.quantity}: {one.note}", highlight=False, markup=False)
    for sentence in part.findings():
        console.print(f"• {sentence}", highlight=False, markup=False)
    console.print()


def _table(grid: Grid) -> Table:
    table = Table(title=grid.title, title_justify="left", box=box.SIMPLE_HEAD)
    for index, head in enumerate(grid.heads):
        table.add_column(head, justify="right" if index else "left")
    for row in grid.rows:
        table.add_row(*row)
    return table
