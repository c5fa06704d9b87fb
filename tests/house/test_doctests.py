"""The examples in the docstrings of the package give what they print.

One module alone: `pytest -n 0 --doctest-modules python/deadtime/loops/_plants.py`.
"""

import doctest
import functools
import importlib
from pathlib import Path

import deadtime
import pytest
from printed_results import failures

PACKAGE = Path(deadtime.__file__).parent
MODULES = [
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
    for path in sorted(PACKAGE.rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


class Finder(doctest.DocTestFinder):
    """Finds the examples of cached properties, too."""

    def _from_module(self, module, thing):
        if isinstance(thing, functools.cached_property):
            thing = thing.func
        return super()._from_module(module, thing)


@pytest.mark.parametrize("module", MODULES)
def test_examples_of_the_docstrings_of_a_module(module):
    found = Finder().find(importlib.import_module(module))
    shown = [failures(examples) for examples in found]
    assert found
    assert not any(shown), "\n".join(shown)
