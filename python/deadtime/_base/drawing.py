"""Figures and axes for all drawings. Matplotlib is imported when something is drawn."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from deadtime._base.extras import library

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:  # for annotations, which nothing reads at run time
    Axes = Figure = Any

DATA: dict[str, Any] = {"color": "0.35", "lw": 0.9, "marker": ".", "ms": 3}
REFERENCE: dict[str, Any] = {"color": "0.6", "lw": 1.0, "ls": "--"}
COLOURS = ("#0b6fb8", "#d1481f", "#2f8f4e", "#8a4fbf")


def check_matplotlib() -> None:
    """Refuse to draw where matplotlib is missing, with the line that installs it."""
    library("matplotlib", "drawing", "'deadtime[plot]'")


def empty_figure(width: float, height: float) -> Figure:
    """Make a figure without a window and without axes."""
    check_matplotlib()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def new_figure(
    width: float = 7.0, height: float = 4.0, rows: int = 1, columns: int = 1, even: bool = False
) -> tuple[Figure, Any]:
    """Make a figure without a window, and its axes; rows share their x axis.

    The first row is the highest one unless `even` is true.
    """
    figure = empty_figure(width, height)
    ratios = None if rows == 1 or even else [3.0, *([1.0] * (rows - 1))]
    axes = figure.subplots(rows, columns, sharex=rows > 1, height_ratios=ratios)
    for ax in np.ravel(axes):
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(alpha=0.25)
    return figure, axes


def shown_axes(ax: Axes | None) -> Axes:
    """The given axes, or those of a new pyplot figure."""
    if ax is not None:
        return ax
    check_matplotlib()
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def shown_rows(ax: Sequence[Axes] | None, rows: int) -> Sequence[Axes]:
    """The given axes, or those of a new pyplot figure below one another."""
    if ax is not None:
        try:
            given = len(ax)
        except TypeError as error:
            raise TypeError(f"ax={ax!r}: give a sequence of {rows} matplotlib axes") from error
        if given != rows:
            raise ValueError(
                f"ax has {given} matplotlib axes, but this picture has {rows} panels: give "
                f"{rows} axes"
            )
        return ax
    check_matplotlib()
    from matplotlib import pyplot

    return list(pyplot.subplots(rows, 1, sharex=True, layout="constrained")[1])


def as_svg(figure: Figure, name: str) -> str:
    """A figure as an SVG element to be put into a page; the same picture gives the same text.

    Matplotlib gives the parts of every picture the same identifiers; `name` before them makes
    those of one page different. Black, white and grey become the colours of the page, light or
    dark.
    """
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "deadtime", "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    drawing = text.getvalue()
    drawing = drawing[drawing.index("<svg") :]
    drawing = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", drawing)
    return re.sub(r"\b(fill|stroke): #([0-9a-f]{2})\2\2\b", _of_page, drawing)


def _of_page(grey: re.Match[str]) -> str:
    """A grey as a mixture of the ink and the ground of a page."""
    ink = round(100.0 * (1.0 - int(grey[2], 16) / 255.0))
    mixed = {0: "var(--ground)", 100: "var(--ink)"}.get(
        ink, f"color-mix(in srgb, var(--ink) {ink}%, var(--ground))"
    )
    return f"{grey[1]}: {mixed}"


def bare_axes(ax: Axes) -> Axes:
    """The axes with a grid and without the lines above and on the right."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.25)
    return ax
