"""The explorer: one HTML file with the kernels in it, in which a loop is looked at live.

Style, scripts and kernels are written into the page, so that it works without a network. The
kernels are the compiled crate ``rust/web``; ``rust/web/make.py`` builds them.
"""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from deadtime._base.page import write_page
from deadtime._base.usual_columns import SECOND_IN, UNITS, USUAL

#: The scripts of the page after the one that its worker shares; a later one uses the earlier ones.
SCRIPTS = (
    *("jobs", "state", "drawing", "map_view", "panels", "fitted", "recording", "controls"),
    *("downloads", "main"),
)

_PLACE = Path(__file__).parent

#: Height of the explorer inside of another page, in pixels, until it sets its own.
_HEIGHT = 1000


@dataclass(frozen=True)
class Explorer:
    """A page in which the numbers of a loop move, and its map, roots and responses follow.

    In a notebook it shows itself.

    Attributes
    ----------
    state : dict
        What the page shows first, as its address and its JSON files have it.
    title : str
        Title of the page.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(Kp=1.5, Kv=0.13), delay=0.36)
    >>> page = loop.explore()
    >>> page.state["delay"]
    0.36
    """

    state: Mapping[str, Any] = field(repr=False)
    title: str = "Control loop with a delay"

    def __hash__(self) -> int:
        return hash((self.title, json.dumps(dict(self.state), sort_keys=True)))

    @property
    def html(self) -> str:
        """The page, some 0.8 MB."""
        from importlib.metadata import version

        given = json.dumps(dict(self.state), allow_nan=False).replace("<", "\\u003c")
        seconds = [unit for unit, count in SECOND_IN.items() if count == 1.0]
        parts = {
            "title": html.escape(self.title),
            "heading": html.escape(self.title),
            "style": _theme() + _part("page.css"),
            "version": html.escape(version("deadtime")),
            "given": given,
            "usual": json.dumps({"names": USUAL, "units": UNITS, "seconds": seconds}),
            "kernels": _kernels(),
            "shared": _part("kernels.js"),
            "script": "\n".join(_part(f"{name}.js") for name in SCRIPTS),
        }
        return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _part("page.html"))

    def save(self, path: str | Path) -> Path:
        """Write the page to `path`, and return that.

        Parameters
        ----------
        path : str or Path
            Its folder is made where there is none.

        Returns
        -------
        Path

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        return write_page(self.html, Path(path))

    def show(self) -> Path:
        """Write the page to a temporary file and open it in the browser.

        Returns
        -------
        Path
            Of the file, which stays.
        """
        import tempfile
        import webbrowser

        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", prefix="deadtime-", suffix=".html", delete=False
        ) as file:
            file.write(self.html)
        webbrowser.open(Path(file.name).as_uri())
        return Path(file.name)

    @property
    def frame(self) -> str:
        """The page as an HTML element, to stand inside of another page."""
        return (
            f'<iframe title="{html.escape(self.title)}" srcdoc="{html.escape(self.html)}" '
            f'loading="lazy" style="width: 100%; height: {_HEIGHT}px; border: 0"></iframe>'
        )

    def _repr_html_(self) -> str:
        return self.frame


def kernels() -> bytes:
    """The compiled kernels, compressed by gzip."""
    return (_PLACE / "kernels.wasm.gz").read_bytes()


@cache
def _kernels() -> str:
    return base64.b64encode(kernels()).decode("ascii")


@cache
def _theme() -> str:
    """The style that the explorer shares with the other pages."""
    return (_PLACE.parent / "templates" / "theme.css").read_text(encoding="utf-8")


@cache
def _part(name: str) -> str:
    return (_PLACE / "parts" / name).read_text(encoding="utf-8")
