"""The pages: their Python gives the printed results, every public name is listed."""

import doctest
import inspect
import pkgutil
import re
import runpy
import tomllib
from pathlib import Path

import deadtime as dtm
import pytest
from printed_results import failures

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


PAGES = [
    "index.md",
    "start/five-minutes.md",
    "start/from-python-control.md",
    "start/from-qpmr-and-dde-biftool.md",
    "guide/emulator.md",
    # A design for intervals takes as long as all other pages together.
    pytest.param("guide/from-recording-to-gains.md", marks=pytest.mark.survey),
    pytest.param("guide/a-plant-that-you-name.md", marks=pytest.mark.survey),
    "guide/recordings-and-checks.md",
    "guide/internet-loop.md",
    "guide/large-maps.md",
    "guide/planning-an-experiment.md",
    "guide/process-loop.md",
    "guide/loads-and-windup.md",
    "guide/sweeps-and-sensitivities.md",
    pytest.param("guide/what-an-answer-means.md", marks=pytest.mark.survey),
    "guide/what-a-ground-log-cannot-tell.md",
]


@pytest.mark.parametrize("page", PAGES)
def test_the_python_of_a_page_runs(page):
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```(?:python|pycon)\n(.*?)```", text, re.DOTALL)
    shown = doctest.DocTestParser().get_doctest("\n".join(blocks), {}, page, page, 0)
    assert len(shown.examples) > 3
    assert not (found := failures(shown)), found


PACKAGES = sorted(package for package in dtm._PACKAGES if package != "_base.errors")


def test_the_reference_has_a_page_for_each_package():
    pages = {path.stem for path in (DOCS / "reference").glob("*.md")}
    assert pages == {*PACKAGES, "index", "errors", "json", "json-vehicles"}
    index = (DOCS / "reference" / "index.md").read_text(encoding="utf-8")
    for package in PACKAGES:
        page = (DOCS / "reference" / f"{package}.md").read_text(encoding="utf-8")
        assert f"automodule:: deadtime.{package}\n" in page
        assert "`_" not in getattr(dtm, package).__doc__, (
            f"{package} shows the name of a private file"
        )
        (row,) = re.findall(rf"^\| \[`{package}`\].*$", index, re.MULTILINE)
        assert re.findall(r"`(\w+)`", row.split("|")[3]) == dtm._PACKAGES[package].split()


def test_every_public_name_has_its_place_in_the_reference():
    tables = tomllib.loads((DOCS / "reference" / "contents.toml").read_text(encoding="utf-8"))
    check = runpy.run_path(str(DOCS / "check.py"), run_name="imported")
    listed = {
        f"deadtime.{package}.{name}"
        for package, pages in tables.items()
        for names in pages.values()
        for name in names.split()
    }
    described = {one for one in check["public_names"]() if one.count(".") == 2}
    assert described - listed == set(), "docs/reference/contents.toml does not list these"
    for name in listed:
        assert pkgutil.resolve_name(name) is not None


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_and_method_of_a_package_is_described(package):
    module = getattr(dtm, package)
    for name in module.__all__:
        thing = getattr(module, name)
        if inspect.isclass(thing):
            for method, body in vars(thing).items():
                if not method.startswith("_") and inspect.isfunction(body):
                    assert inspect.getdoc(getattr(thing, method)), f"{name}.{method}"
        if callable(thing):
            assert inspect.getdoc(thing), name


def test_the_citation_is_that_of_this_version():
    cargo = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    (version,) = re.findall(r'^version = "(.+)"', cargo, re.MULTILINE)
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version = {{{version}}}" in (DOCS / "start/citing.md").read_text(encoding="utf-8")


def test_each_promise_names_a_test_or_survey_that_exists():
    text = (DOCS / "theory/promises.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    promises = [row for row in rows if not row.startswith("| promise ")]
    assert len(promises) > 30
    for row in promises:
        named = re.findall(r"`([\w/]+\.(?:py|rs))::(\w+)`", row)
        assert named, f"no test holds the promise {row!r}"
        for path, name in named:
            source = (ROOT / path).read_text(encoding="utf-8")
            assert re.search(rf"\b(?:def|fn) {name}\b", source), f"{path} has no {name}"
    for path in re.findall(r"`python ([\w/]+\.py)\b", text):
        assert (ROOT / path).is_file(), f"no survey {path}"


@pytest.mark.parametrize("script", sorted(DOCS.glob("*.py")), ids=lambda path: path.name)
def test_the_scripts_of_the_pages_find_what_they_import(script):
    for needed in ("matplotlib", "sphinx"):
        pytest.importorskip(needed)
    runpy.run_path(str(script), run_name="imported")
