"""Each Python block of the README and the pages runs, and says what it takes from those before it.

Its first line is then ``# with loop and flight from above``; modules are imported again. Blocks
with printed results are run by `test_pages`, and those of the README by `test_readme`.
"""

import ast
import builtins
import doctest
import importlib.util
import re
import symtable
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FENCED = re.DOTALL | re.MULTILINE
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(page: Path) -> Iterator[str]:
    text = page.read_text(encoding="utf-8")
    for block in re.findall(r"^```(?:python|pycon|py)\n(.*?)^```", text, FENCED):
        examples = doctest.DocTestParser().get_examples(block)
        source = "".join(example.source for example in examples)
        # The parser drops a line that is nothing but a comment.
        yield re.match(r"(?:>>> )?(#.*\n)?", block)[1] or "\n", source or block


def global_names(table: symtable.SymbolTable) -> Iterator[str]:
    for symbol in table.get_symbols():
        if symbol.is_referenced() and (symbol.is_global() or table.get_type() == "module"):
            yield symbol.get_name()
    for inner in table.get_children():
        yield from global_names(inner)


def names_of(code: str) -> tuple[set[str], set[str]]:
    """Global names that a piece of code reads, and those that it binds."""
    table = symtable.symtable(code, "block", "exec")
    bound = {
        symbol.get_name()
        for symbol in table.get_symbols()
        if symbol.is_assigned() or symbol.is_imported() or symbol.is_namespace()
    }
    return set(global_names(table)), bound


def names_needed(source: str) -> set[str]:
    """Names that the block reads before it binds them."""
    known, needed = set(dir(builtins)), set()
    for statement in ast.parse(source).body:
        read, bound = names_of(ast.unparse(statement))
        # `fit = improved(fit)` reads the name first; a loop or a function binds it first.
        if isinstance(statement, ast.Assign):
            first = names_of(ast.unparse(statement.value))[0] | (read - bound)
        elif isinstance(statement, ast.AugAssign):
            first = read | bound
        else:
            first = read - bound
        needed |= first - known
        known |= bound
    return needed


def names_declared(first_line: str) -> set[str]:
    said = re.match(r"# with (.+) from above$", first_line.strip())
    return set(re.split(r", | and ", said[1])) if said else set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_block_says_what_it_takes_from_above(page):
    defined: set[str] = set()
    for first_line, source in blocks(page):
        needed = names_needed(source)
        assert names_declared(first_line) == needed, f"the block\n{source}\nneeds {sorted(needed)}"
        assert needed <= defined, f"no block above defines {sorted(needed - defined)}"
        for statement in ast.parse(source).body:
            if not isinstance(statement, ast.Import | ast.ImportFrom):
                defined |= names_of(ast.unparse(statement))[1]


def without_results():
    for page in PAGES[1:]:
        text = page.read_text(encoding="utf-8")
        if "```python\n" in text and ">>> " not in text:
            # These take longer than all others together.
            slow = page.stem in ("designing", "gains-that-follow-the-delay", "reproduction")
            yield pytest.param(
                page, id=page.stem, marks=[pytest.mark.survey, pytest.mark.long] if slow else []
            )


def is_installed(source: str) -> bool:
    imports = [node for node in ast.parse(source).body if isinstance(node, ast.Import)]
    return all(importlib.util.find_spec(alias.name) for node in imports for alias in node.names)


@pytest.mark.parametrize("page", list(without_results()))
def test_blocks_without_printed_results_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for _, source in blocks(page):
        if is_installed(source):
            exec(compile(source, str(page), "exec"), names)
    assert len(names) > 2
    # A page whose code prints nothing shows what commands print.
    if printed := capsys.readouterr().out:
        for shown in re.findall(r"^```text\n(.*?)^```", page.read_text(encoding="utf-8"), FENCED):
            assert shown in printed, f"the page shows\n{shown}\nand its code prints\n{printed}"


@pytest.mark.parametrize(
    ("source", "needed"),
    [
        ("import numpy as np\nx = np.pi", set()),
        ("fit = better(fit)\nfit", {"better", "fit"}),
        ("def f(a):\n    return a + b", {"b"}),
        ("[k * gain for k in range(3)]", {"gain"}),
        ("for k in range(3):\n    print(k)", set()),
        ("x.y = 1\nz[0] = x", {"x", "z"}),
        ("total += 1", {"total"}),
        ("with open(name) as file:\n    file.read()", {"name"}),
    ],
)
def test_names_that_a_block_needs(source, needed):
    assert names_needed(source) == needed
