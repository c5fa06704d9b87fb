"""HTML pages in one file, made from templates: nothing is loaded from elsewhere.

A template lies beside the file that fills it and extends ``_base/templates/layout.html``, which
holds head, style and footer. Everything put into a page is escaped.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from deadtime._base.drawing import Figure, as_svg, check_matplotlib
from deadtime._base.extras import library


def page(template: str, **values: object) -> str:
    """Fill the template of this name, a path inside of the package."""
    from importlib.metadata import version

    _check_engine()
    filled: str = (
        _environment().get_template(template).render(version=version("deadtime"), **values)
    )
    return filled


def write_page(text: str, path: Path) -> Path:
    """Write a page to `path`, creating its folder where necessary, and return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def check_pages() -> None:
    """Refuse to make pages where what they need is missing, with the line that installs it."""
    _check_engine()
    check_matplotlib()


def _check_engine() -> None:
    library("jinja2", "a page", "'deadtime[cli]'")


@cache
def _environment() -> Any:
    import jinja2

    found = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parents[1]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    found.filters["svg"] = _svg
    return found


def _svg(figure: Figure, name: str) -> Any:
    """A figure as an element that its caption describes."""
    from markupsafe import Markup

    drawing = as_svg(figure, name)
    label = f'<svg role="img" aria-labelledby="{name}-caption" '
    return Markup(drawing.replace("<svg ", label, 1))
