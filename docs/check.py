"""Check built pages: ``python docs/check.py docs/_build/html``.

Every link inside of the pages leads somewhere, a page loads nothing from the network, and every
public name of every package, methods and attributes of its classes included, has an entry in the
reference.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import deadtime as dtm

#: Names without an entry of their own: values and types that a sentence of their page explains.
VALUES = {"roots.s", "loops.PAIR", "experiments.Noise", "links.AXES"}


#: An address of the network, not one of a namespace of XML.
NETWORK = r"(?:https?:)?//[^/\s]"


class Page(HTMLParser):
    """Links and anchors of a page, and what it loads."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.loaded: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep what it links to, and its name."""
        values = dict(attrs)
        self.anchors |= {name for name in (values.get("id"), values.get("name")) if name}
        self.links += [link for link in (values.get("href"), values.get("src")) if link]
        shown = ["src", "srcset", "poster", "data"] + ["href"] * (tag in ("link", "image", "use"))
        self.loaded += [values[name] or "" for name in shown if name in values]
        self.loaded += addresses_in_styles(values.get("style") or "")

    def handle_data(self, data: str) -> None:
        """Keep what its styles load."""
        if self.cdata_elem == "style":
            self.loaded += addresses_in_styles(data)


def addresses_in_styles(text: str) -> list[str]:
    """What a style sheet loads."""
    return re.findall(r"""(?:url\(\s*|@import\s+)["']?([^"')\s]+)""", text)


def loaded_from_the_network(root: Path) -> Iterator[str]:
    """Scripts, styles, fonts and pictures that a page takes from another host."""
    loaded = {path: Page(path).loaded for path in root.rglob("*.html")}
    for path in root.rglob("*.css"):
        loaded[path] = addresses_in_styles(path.read_text(encoding="utf-8"))
    for path, addresses in loaded.items():
        for address in addresses:
            if re.match(NETWORK, address) or re.search(rf",\s*{NETWORK}", address):
                yield f"{path.relative_to(root)}: loads {address} from the network"


def broken_links(root: Path) -> Iterator[str]:
    """Links that lead nowhere, those to other places on the network left out."""
    pages = {path.resolve(): Page(path) for path in root.rglob("*.html")}
    for path, page in pages.items():
        for link in page.links:
            if ":" in link.split("/")[0]:
                continue
            name, anchor = urldefrag(link)
            target = (path.parent / unquote(name.split("?")[0])).resolve() if name else path
            if not target.exists():
                yield f"{path.relative_to(root.resolve())}: {link}"
            elif anchor and target in pages and unquote(anchor) not in pages[target].anchors:
                yield f"{path.relative_to(root.resolve())}: {link}: no such place"


def public_names() -> Iterator[str]:
    """Every public name of the packages, and of the members that their classes define."""
    packages = (name for name in dir(dtm) if inspect.ismodule(getattr(dtm, name)))
    for package in packages:
        module = importlib.import_module(f"deadtime.{package}")
        for name in module.__all__:
            value = getattr(module, name)
            if f"{package}.{name}" in VALUES or (name.isupper() and not inspect.isclass(value)):
                continue
            yield f"deadtime.{package}.{name}"
            if inspect.isclass(value):
                yield from (f"deadtime.{package}.{name}.{one}" for one in members(value))


def members(kind: type) -> Iterator[str]:
    """Methods and properties of a class that the package defines."""
    for name in dir(kind):
        owner = (
            next(base for base in kind.__mro__ if name in vars(base)) if name[0] != "_" else None
        )
        if owner is None or not owner.__module__.startswith("deadtime"):
            continue
        found = inspect.getattr_static(kind, name)
        is_property = isinstance(found, property) or hasattr(found, "attrname")
        if is_property or isinstance(found, (classmethod, staticmethod)) or callable(found):
            yield name


def main() -> int:
    """Print what is wrong, and return the exit code."""
    root = Path(sys.argv[1])
    wrong = [*broken_links(root), *loaded_from_the_network(root)]
    entries = set().union(*(Page(path).anchors for path in (root / "reference").rglob("*.html")))
    names = list(public_names())
    wrong += [f"{name}: no entry in the reference" for name in names if name not in entries]
    print(
        "\n".join(wrong)
        or f"all links lead somewhere, nothing is loaded, {len(names)} names have entries"
    )
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
