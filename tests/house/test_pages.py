"""The pages: their Python runs with the results that are printed, every public name is listed."""

import doctest
import re
from pathlib import Path

import deadtime as dtm
import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


PAGES = [
    "emulator.md",
    "from-recording-to-gains.md",
    "internet-loop.md",
    "planning-a-flight.md",
    "what-a-ground-log-cannot-tell.md",
]


@pytest.mark.parametrize("page", PAGES)
def test_the_python_of_a_page_runs(page):
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    examples = doctest.DocTestParser().get_doctest("\n".join(blocks), {}, page, page, 0)
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    runner.run(examples, out=told.append)
    assert runner.summarize(verbose=False).attempted > 3
    assert not told, "".join(told)


def test_the_reference_lists_every_public_name_once():
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    ours = [part for part in text.split("```{eval-rst}") if "currentmodule:: deadtime\n" in part]
    listed = re.findall(r"^   (\w+)$", "".join(ours), re.MULTILINE)
    assert sorted(listed) == sorted(set(dtm.__all__) - {"gallery"})  # it has a part of its own


def test_each_promise_names_a_test_or_survey_that_exists():
    text = (DOCS / "promises.md").read_text(encoding="utf-8")
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
