"""Output of results in a terminal: JSON, tables, figures and progress bars."""

from __future__ import annotations

import csv
import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from deadtime._base.drawing import check_matplotlib
from deadtime._base.plain import json_text
from deadtime._base.printable import printable
from deadtime._cli.readable import shows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

console = Console()
PICTURES = (".png", ".svg", ".pdf")


def print_json(schema: str, found: Mapping[str, Any]) -> None:
    """Print values as JSON."""
    text = json_text(schema, found)
    print(
        text if shows(text) and printable(text) == text else json.dumps(json.loads(text), indent=2)
    )


def print_table(table: Table) -> None:
    """Print a table in its full width, so that a narrow terminal does not cut digits off."""
    needed = Console(width=1000).measure(table).maximum
    Console(width=max(console.width, needed)).print(table, soft_wrap=True)


def results_table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    title: str | None = None,
    left: Sequence[str] = (),
) -> Table:
    """A table of text; the columns of `left` are adjusted to the left, the others to the right."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for head in heads:
        table.add_column(head, justify="left" if head in left else "right")
    for row in rows:
        table.add_row(*map(printable, row))
    return table


def print_text(
    text: str, style: str | None = None, wrapped: bool = True, on: Console = console
) -> None:
    """Print a text as it is: nothing in it is markup or highlighted, or obeyed by a terminal."""
    on.print(printable(text), style=style, highlight=False, markup=False, soft_wrap=not wrapped)


def print_points(sentences: Iterable[str]) -> None:
    """Print sentences as a list."""
    for sentence in sentences:
        print_text(f"• {sentence}")


def check_picture(path: Path) -> None:
    """Refuse a file to which no figure can be written; called before the long computation."""
    check_matplotlib()
    if path.suffix.lower() not in PICTURES:
        raise ValueError(
            f"the name of a picture must end in {', '.join(PICTURES)}, but {path} is given"
        )
    if not path.parent.is_dir():
        raise ValueError(
            f"{path}: the folder {path.parent} does not exist. Create this folder, or give "
            "another one"
        )


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure to a file; its suffix determines the format."""
    check_picture(path)
    figure.savefig(path, dpi=150)


def write_rows(path: Path, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table as CSV."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([heads, *rows])


ERRORS = Console(stderr=True)


@contextmanager
def _bar(
    what: str, total: int, quiet: bool, on: Console = ERRORS
) -> Iterator[Callable[..., object]]:
    """Change a progress bar, which is removed at its end, if there is one."""
    if quiet or not on.is_terminal:
        yield lambda **change: None
        return
    words = TextColumn("{task.description}")
    columns = (SpinnerColumn(), words, BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=on, transient=True) as progress:
        yield partial(progress.update, progress.add_task(printable(what), total=total))


@contextmanager
def counted(what: str, total: int, quiet: bool) -> Iterator[bool | Callable[[int], object]]:
    """A progress bar over `total` items; call it with the number of finished items."""
    with _bar(what, total, quiet) as change:
        yield False if quiet or not ERRORS.is_terminal else lambda done: change(completed=done)


@contextmanager
def results(what: str, count: int, quiet: bool) -> Iterator[Callable[[str | None], None]]:
    """Print lines on standard output as results come, above a progress bar over so many.

    Each line is there at once, in a pipe too. Beside a pipe there is no bar: who reads it may
    write on the same terminal.
    """
    with _bar(what, count, quiet, console) as change:

        def tell(line: str | None) -> None:
            if line is not None and not quiet:
                print_text(line, wrapped=False)
            change(advance=1)

        yield tell


@contextmanager
def stages(count: int, quiet: bool) -> Iterator[Callable[[str], object]]:
    """A progress bar over named stages, on standard error; call it as each stage begins."""
    begun = itertools.count()
    with _bar("", count, quiet) as change:
        yield lambda stage: change(description=printable(stage), completed=next(begun))
