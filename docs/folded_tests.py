"""On the page of promises, the tests of each promise are folded away below their number."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

PAGE = "theory/promises"


def _fold(app: Sphinx, tree: nodes.document) -> None:
    if app.env.docname != PAGE:
        return
    for body in list(tree.findall(nodes.tbody)):
        for row in body.findall(nodes.row):
            tests = row[1]
            number = sum("::" in name.astext() for name in tests.findall(nodes.literal))
            said = f"{number} test{'s' * (number > 1)}"
            opened = f"<details><summary>{said}</summary>"
            tests.insert(0, nodes.raw("", opened, format="html"))
            tests.append(nodes.raw("", "</details>", format="html"))


def setup(app: Sphinx) -> dict[str, Any]:
    """Change the page when it has been read."""
    app.connect("doctree-read", _fold)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
