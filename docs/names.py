"""Public names in the text of pages and docstrings become links to their entries in the reference.

A name that is also a plain word, such as `delay`, stays as it is unless it is written `dtm.delay`.
"""

import re
from collections import Counter
from functools import cache
from importlib import import_module
from typing import Any

import deadtime as dtm
from docutils import nodes
from entries import contents
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.environment import BuildEnvironment


@cache
def _entries() -> dict[str, str]:
    """By name the full name of an entry: names of one package alone, and all with their package."""
    found = [
        (package, one)
        for package, pages in contents().items()
        for names in pages.values()
        for one in names
    ]
    often = Counter(name for _, name in found)
    full = {f"{package}.{name}": f"deadtime.{package}.{name}" for package, name in found}
    full |= {name: f"deadtime.{package}.{name}" for package, name in found if often[name] == 1}
    of_all = {name: package for package, names in dtm._PACKAGES.items() for name in names.split()}
    return full | {name: f"deadtime.{package}.{name}" for name, package in of_all.items()}


def _full_name(written: str) -> str | None:
    """The entry that a piece of text names: ``dtm.design``, ``ControlLoop.poles``, ``sweep()``."""
    match = re.fullmatch(r"(dtm\.|deadtime\.)?([A-Za-z][\w.]*)(\(.*\))?", written)
    if match is None:
        return None
    prefix, name, called = match.groups()
    if not (prefix or called or re.search("[A-Z_]", name)):
        return None
    owner, _, member = name.rpartition(".")
    entries = _entries()
    if name in entries or owner not in entries:
        return entries.get(name)
    package, _, kind = entries[owner].rpartition(".")
    thing = getattr(import_module(package), kind, None)
    is_method = isinstance(thing, type) and callable(getattr(thing, member, None))
    return f"{entries[owner]}.{member}" if is_method else None


def _link_literals(app: Sphinx, tree: nodes.document) -> None:
    for literal in list(tree.findall(nodes.literal)):
        if isinstance(literal.parent, nodes.reference | nodes.title | pending_xref):
            continue
        if target := _full_name(literal.astext()):
            link = pending_xref(
                "", refdomain="py", reftype="obj", reftarget=target, refexplicit=True
            )
            link["refdoc"] = app.env.docname
            literal.replace_self(link)
            link += literal


def _link_types(app: Sphinx, config: Config) -> None:
    """Types of arguments are classes of the package; those of the language have no page here."""
    config.numpydoc_xref_aliases_complete = {
        name: full for name, full in _entries().items() if re.fullmatch("[A-Z][A-Za-z]+", name)
    }


def _resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, shown: nodes.Node) -> Any:
    """A name of another package, in a docstring."""
    target = node.get("reftarget", "")
    if node.get("refdomain") != "py" or not (full := _full_name(target)) or full == target:
        return None
    domain = env.domains.python_domain
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", full, node, shown)


def setup(app: Sphinx) -> dict[str, Any]:
    """Link types, literals when a page has been read, and names that nothing else resolves."""
    app.connect("config-inited", _link_types, priority=900)
    app.connect("doctree-read", _link_literals)
    app.connect("missing-reference", _resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
