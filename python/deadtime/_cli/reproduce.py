"""The command that reproduces the paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.fills import filled
from deadtime._cli.show import (
    print_json,
    print_points,
    print_table,
    print_text,
    results_table,
    save_figure,
    stages,
)
from deadtime.paper import HEADS, PARTS, TITLES, Part, Verdict, reproduce, write_reproduction

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


@filled
def command(
    out: Path = Path("reproduction"),
    page: Path | None = None,
    only: Annotated[
        str | None,
        typer.Option(
            help=(
                f"Parts to reproduce, with commas between them. Possible parts: {', '.join(PARTS)}."
            )
        ),
    ] = None,
    pictures: Literal["png", "svg", "pdf"] = "png",
    as_json: opt.As_json = False,
) -> None:
    """Reproduce the paper on delays in quadrotor control, and compare each printed number.

    Parameters
    ----------
    out
        Folder for the figures and the page.
    page
        File of the page. Default: reproduction.html in the folder.
    pictures
        Format of the figures.
    """
    check_pages()
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
        print_json("reproduction", {**found.to_dict(), "figures": files, "page": written})
        return
    for name, part in found.parts.items():
        _show(TITLES[name], part)
    print_text(found.summary(), "bold")
    print_text(f"figures: {out}, page: {written}")


def _show(title: str, part: Part) -> None:
    print_text(title, "bold")
    if part.comparisons:
        rows = [
            (
                row.where,
                row.quantity,
                row.printed,
                row.shown,
                f"[{STYLES[row.verdict]}]{row.outcome}[/]",
            )
            for row in part.comparisons
        ]
        print_table(results_table(HEADS[:5], rows, left=("where", "what", "verdict")))
    for grid in part.grids():
        print_table(results_table(grid.heads, grid.rows, grid.title, grid.heads[:1]))
    unsettled = [row for row in part.comparisons if row.note and row.verdict not in SETTLED]
    print_points(f"{row.quantity}: {row.note}" for row in unsettled)
    print_points(part.findings())
    print_text("")
