"""Pages of the reference, from ``reference/contents.toml``: tables of names, and their entries.

``.. entries:: roots`` shows what is in a package: a table for each page, and the pages as its
contents.
"""

import inspect
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

sys.path.insert(0, str(Path(__file__).parent))
from check import members

REFERENCE = Path(__file__).parent / "reference"

#: Classes of the language, whose members are not those of a class.
BASES = "object, tuple, int, Exception"

#: Classes with fewer methods have no table of them.
FEW = 4


def contents() -> dict[str, dict[str, list[str]]]:
    """By package the names on each page, by its title."""
    read = tomllib.loads((REFERENCE / "contents.toml").read_text(encoding="utf-8"))
    return {
        package: {title: names.split() for title, names in pages.items()}
        for package, pages in read.items()
    }


def folder(package: str) -> str:
    """Folder of the pages of a package, those inside of it included."""
    return package.split(".")[0]


def is_on_own_page(package: str) -> bool:
    """Whether the names of a package stand on its page, and not on others."""
    return "." not in package and len(contents()[package]) == 1


def slug(title: str) -> str:
    """The name of a page's file."""
    return "-".join(re.findall(r"\w+", title.lower()))


def table(names: list[str]) -> Iterator[str]:
    """A table of names of the current module with their first sentences."""
    yield from (".. autosummary::", "   :nosignatures:", "")
    yield from (f"   ~{name}" for name in names)
    yield ""


def entry(package: str, name: str, elsewhere: list[str]) -> Iterator[str]:
    """The entry of a class with a table of its methods, of a function or of a method."""
    thing: Any = import_module(f"deadtime.{package}")
    for part in name.split("."):
        thing = inspect.getattr_static(thing, part)
    full = f"deadtime.{package}.{name}"
    if inspect.isclass(thing):
        moved = [one.split(".")[1] for one in elsewhere if one.startswith(f"{name}.")]
        here = [one for one in members(thing) if one not in moved]
        if len(here) > FEW:
            yield from table([f"{name}.{one}" for one in here])
        yield from (f".. autoclass:: {full}", "   :members:", f"   :inherited-members: {BASES}")
        yield from ([f"   :exclude-members: {', '.join(moved)}"] if moved else [])
        yield ""
    else:
        is_property = isinstance(thing, property) or hasattr(thing, "attrname")
        kind = "property" if is_property else "method" if "." in name else "function"
        yield from (f".. auto{kind}:: {full}", "")


def page(package: str, title: str) -> Iterator[str]:
    """The table of a page and its entries."""
    names = contents()[package][title]
    elsewhere = [name for names in contents()[package].values() for name in names if "." in name]
    if len(names) > 1:
        yield from table(names)
    for name in names:
        yield from entry(package, name, elsewhere)


def write_pages(app: Sphinx) -> None:
    """Write the pages that are not those of packages; delete those that are no longer listed."""
    written = set()
    for package, pages in contents().items():
        for title in pages if not is_on_own_page(package) else ():
            path = REFERENCE / folder(package) / f"{slug(title)}.rst"
            within = [
                f".. currentmodule:: deadtime.{package}",
                "",
                f"In ``deadtime.{package}``.",
                "",
            ]
            lines = [title, "=" * len(title), "", *within]
            text = "\n".join([*lines, *page(package, title)])
            path.parent.mkdir(exist_ok=True)
            if not path.exists() or path.read_text(encoding="utf-8") != text:
                path.write_text(text, encoding="utf-8")
            written.add(path)
    for path in {*REFERENCE.glob("*/*.rst")} - written:
        path.unlink()


class Entries(SphinxDirective):
    """What is in a package, by page."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Tables and contents, or all entries where one page has them."""
        package = self.arguments[0]
        self.env.note_dependency(str(REFERENCE / "contents.toml"))
        if is_on_own_page(package):
            (title,) = contents()[package]
            return self.parse_text_to_nodes("\n".join(page(package, title)))
        lines = [".. toctree::", "   :hidden:", ""]
        lines += [f"   {folder(package)}/{slug(title)}" for title in contents()[package]]
        for title, names in contents()[package].items():
            lines += ["", f".. rubric:: :doc:`{folder(package)}/{slug(title)}`", ""]
            lines += table(names)
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before any is read."""
    app.add_directive("entries", Entries)
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
