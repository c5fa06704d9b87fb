"""What a user installs along with the package may be passed on with it."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
NAMED = [
    *PROJECT["dependencies"],
    *EXTRAS["plot"],
    *EXTRAS["cli"],
    *EXTRAS["logs"],
    *EXTRAS["adapt"],
    *EXTRAS["mavlink"],
]

#: LGPL: a library that a user may exchange, imported where a log is read and not passed on.
EXCHANGEABLE = {"pymavlink"}

#: Licences without conditions on programs that use the package; of "any-OSI" a user chooses one.
PERMISSIVE = re.compile(
    r"\b(MIT|BSD|Apache|PSF|Python Software Foundation|HPND|MIT-CMU|ISC|Zlib|any-OSI)\b",
    re.IGNORECASE,
)
COPYLEFT = re.compile(r"\b(A?GPL|GNU)\b")


def installed(wanted):
    """The names of these packages and of all that they need, as far as they are installed."""
    found, waiting = set(), [Requirement(one) for one in wanted]
    while waiting:
        one = waiting.pop()
        if one.name in found or (one.marker and not one.marker.evaluate({"extra": ""})):
            continue
        try:
            needs = distribution(one.name).requires or []
        except PackageNotFoundError:
            continue
        found.add(one.name)
        waiting += map(Requirement, needs)
    return sorted(found)


@pytest.mark.parametrize("name", [one for one in installed(NAMED) if one not in EXCHANGEABLE])
def test_a_package_that_comes_along_has_a_permissive_licence(name):
    told = distribution(name).metadata
    classifiers = [one for one in told.get_all("Classifier", []) if one.startswith("License ::")]
    # Where there is an expression it is the licence; the text in the old field may be a whole page.
    # With importlib_metadata a missing key raises.
    expression, text = told.get("License-Expression"), told.get("License")
    stated = expression or " ".join(classifiers) or (text or "")[:200]
    assert PERMISSIVE.search(stated), stated
    assert not COPYLEFT.search(stated), stated


def test_what_the_package_needs_is_looked_at():
    assert {"numpy", "scipy", "matplotlib", "typer", "rich", "jinja2"} <= set(installed(NAMED))
