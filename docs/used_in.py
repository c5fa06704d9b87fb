"""Below each entry of the reference: the examples that use it."""

import re
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx


def _add_examples(
    app: Sphinx, kind: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    package, _, rest = name.removeprefix("deadtime.").partition(".")
    folder = Path(app.srcdir, app.config.sphinx_gallery_conf["backreferences_dir"])
    # Of a method there is a file for each of the classes that share it, each by its short name.
    found = folder / f"deadtime.{rest or package}.examples"
    if kind == "module" or not found.exists():
        return
    pages = dict.fromkeys(re.findall(r":doc:`(.+?)`", found.read_text(encoding="utf-8")))
    if pages:
        links = ", ".join(f":doc:`{page}`" for page in pages)
        lines += ["", ".. rubric:: Used in", "", f"{links}.", ""]


def setup(app: Sphinx) -> dict[str, Any]:
    """Extend docstrings after numpydoc has read them."""
    app.connect("autodoc-process-docstring", _add_examples, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
