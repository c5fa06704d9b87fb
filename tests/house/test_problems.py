"""The five problems of the gallery: their answers quote what their scripts print."""

import ast
import contextlib
import io
import re
import runpy
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROBLEMS = sorted((ROOT / "examples/problems").glob("*.py"))
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?")
PARTS = ("Question", "Data", "Answer", "Next")


def parts_of(script: Path) -> dict[str, str]:
    """The parts of the page's text, by name."""
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    pieces = re.split(r"^\*\*(\w+)\.\*\* ", text, flags=re.MULTILINE)
    return dict(zip(pieces[1::2], pieces[2::2], strict=True))


def numbers(text: str) -> list[float]:
    return [float(number) for number in NUMBER.findall(text)]


def test_there_are_five():
    assert len(PROBLEMS) == 5


@pytest.mark.parametrize("script", PROBLEMS, ids=lambda path: path.stem)
def test_a_page_has_its_parts_and_a_command(script):
    parts = parts_of(script)
    assert tuple(parts) == PARTS
    command = parts["Next"].partition("::\n\n")[2].replace("\\\n", " ")
    program, name = shlex.split(command)[:2]
    assert program == "deadtime"
    assert f"`deadtime {name}" in (ROOT / "docs/guide/command-line.md").read_text(encoding="utf-8")


@pytest.mark.survey
@pytest.mark.parametrize("script", PROBLEMS, ids=lambda path: path.stem)
def test_an_answer_quotes_what_is_printed(script):
    pytest.importorskip("matplotlib").use("agg")
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        runpy.run_path(str(script))
    parts = parts_of(script)
    # 95 % is the level of an interval.
    given = {95.0, *numbers(parts["Data"]), *numbers(parts["Question"])}
    known = numbers(printed.getvalue())
    for number in NUMBER.findall(parts["Answer"]):
        digits = len(number.partition(".")[2])
        near = [value for value in known if round(value, digits) == float(number)]
        assert near or float(number) in given, f"{number} is not printed"
