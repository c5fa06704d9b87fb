"""HTML pages in one file, with their style and pictures in it: nothing is loaded from elsewhere."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from deadtime._base.drawing import as_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure


STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.55 system-ui, sans-serif; color: #222; max-width: 52rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; }
h2 { font-size: 1.15rem; margin-top: 2rem; }
.verdict { background: #eef4fa; border-left: 4px solid #0b6fb8; padding: .8rem 1rem; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
caption { text-align: left; font-weight: 600; padding: .8rem 0 .2rem; }
th, td { text-align: right; padding: .25rem .6rem; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
tr.truth td { font-weight: 600; background: #f5f5f0; }
figure { margin: 1rem 0; }
figcaption { color: #555; font-size: .9rem; }
svg { max-width: 100%; height: auto; }
pre { white-space: pre-wrap; }
"""


def page(title: str, body: Iterable[str], style: str = "") -> str:
    """A page with this title and body; `style` is added to that of all pages."""
    return "\n".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escaped(title)}</title><style>{STYLE}{style}</style></head><body>",
            f"<h1>{escaped(title)}</h1>",
            *body,
            "</body></html>\n",
        ]
    )


def write_page(text: str, path: Path) -> Path:
    """Write a page to `path`, creating its folder where necessary, and return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def table_row(cells: Sequence[str], tag: str, width: int) -> str:
    """Make a row; its last cell spans the remaining ones of `width` columns."""
    span = width - len(cells) + 1
    scope = ' scope="col"' if tag == "th" else ""
    opened = [f"<{tag}{scope}>"] * (len(cells) - 1)
    opened.append(f'<{tag}{scope} colspan="{span}">' if span > 1 else f"<{tag}{scope}>")
    inner = "".join(
        f"{open_}{escaped(cell)}</{tag}>" for open_, cell in zip(opened, cells, strict=True)
    )
    return f"<tr>{inner}</tr>"


def table(heads: Sequence[str], rows: Iterable[str], title: str = "") -> str:
    """Make a table from rows in HTML."""
    caption = f"<caption>{escaped(title)}</caption>" if title else ""
    return f"<table>{caption}{table_row(heads, 'th', len(heads))}{''.join(rows)}</table>"


def picture(name: str, figure: Figure, caption: str) -> str:
    """A figure with its caption."""
    drawing = as_svg(figure, name).replace(
        "<svg ", f'<svg role="img" aria-labelledby="{name}-caption" ', 1
    )
    return (
        f'<figure>{drawing}<figcaption id="{name}-caption">{escaped(caption)}</figcaption></figure>'
    )


def escaped(words: str) -> str:
    """Escape text for a page."""
    return html.escape(words)
