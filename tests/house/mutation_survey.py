"""Mutation survey: which changed signs, bounds and operators of the package fail no test.

    python tests/house/mutation_survey.py --mutants 200 --seed 1

Each mutant is one change in one line, drawn at random. It is written into a copy of the package and
of the tests, and the tests of its package are run until the first failure; a mutant that none
fails, or that only a limit on time ends, is listed. Each one listed either changes nothing (say why
in the review) or asks for a test. Not a part of .ci/run: 200 mutants take an hour or two. The
native module has to be in the tree, where `maturin develop` puts it.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path("python/deadtime")

#: What is mutated. The tests of each are in the folder of `tests` named after the first word.
PLACES = (
    "special", "dde", "roots", "systems", "loops", "stability", "recordings", "experiments",
    "estimation", "tuning", "logs", "flights",
    "links/safety.py", "links/mavlink", "links/ardrone2/reader.py", "links/ardrone2/sender.py",
    "links/ardrone2/limit_settings.py", "links/udp/classifier.py",
)  # fmt: skip
#: Exit code of a run that did not come to its tests.
BROKEN = 99
#: The test that runs the examples of a module.
EXAMPLES = "tests/house/test_doctests.py::test_examples_of_the_docstrings_of_a_module"
#: Imported once for all runs.
LIBRARIES = ("mpmath", "numpy", "scipy.linalg", "scipy.optimize", "scipy.signal")

#: Files that compute nothing.
LEFT_OUT = re.compile(r"__init__|plots|_page|_repr|_low_level")
#: Signals that end a run for its time; any other ends it for what the mutant did.
LIMITS = (signal.SIGXCPU, signal.SIGKILL, signal.SIGALRM)
#: Largest memory of a run, bytes.
MEMORY = 4 * 2**30

COMPARISONS = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
}  # fmt: skip
OPERATORS = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "/", ast.Pow: "*",
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One change: the text between two offsets of a file, in bytes, gives way to another."""

    path: Path
    line: int
    start: int
    stop: int
    text: str
    kind: str

    def apply(self, source: bytes) -> bytes:
        return source[: self.start] + self.text.encode() + source[self.stop :]

    def shown(self, source: bytes) -> str:
        before = source.splitlines()[self.line - 1].decode().strip()
        after = self.apply(source).splitlines()[self.line - 1].decode().strip()
        return f"{before}\n      -> {after}"


class Mutants(ast.NodeVisitor):
    """All mutants of a file; annotations, docstrings and messages are no part of it."""

    def __init__(self, path: Path, source: bytes) -> None:
        self.path, self.source = path, source
        self.found: list[Mutant] = []
        self.lines = [0]
        for line in source.splitlines(keepends=True):
            self.lines.append(self.lines[-1] + len(line))
        self.visit(ast.parse(source))

    def at(self, line: int, column: int) -> int:
        return self.lines[line - 1] + column

    def begin(self, node: ast.expr) -> int:
        return self.at(node.lineno, node.col_offset)

    def end(self, node: ast.expr) -> int:
        return self.at(node.end_lineno or 0, node.end_col_offset or 0)

    def add(self, start: int, stop: int, text: str, kind: str) -> None:
        line = self.source[:start].count(b"\n") + 1
        self.found.append(Mutant(self.path, line, start, stop, text, kind))

    def between(self, left: ast.expr, right: ast.expr, words: str, text: str, kind: str) -> None:
        """Replace an operator between two operands; brackets may stand around it."""
        begin, gap = self.end(left), self.source[self.end(left) : self.begin(right)]
        at = re.search(rb"(?<![*/<>=!])" + re.escape(words.encode()) + rb"(?![*/=])", gap)
        if at:
            self.add(begin + at.start(), begin + at.end(), text, kind)

    def visit_Compare(self, node: ast.Compare) -> None:
        left = node.left
        for operator, right in zip(node.ops, node.comparators, strict=True):
            if type(operator) in COMPARISONS:
                words = {
                    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==",
                    ast.NotEq: "!=",
                }[type(operator)]  # fmt: skip
                self.between(left, right, words, COMPARISONS[type(operator)], "comparison")
            left = right
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        words = {
            ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//",
            ast.Pow: "**",
        }.get(type(node.op))  # fmt: skip
        if words:
            self.between(node.left, node.right, words, OPERATORS[type(node.op)], "operator")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        swaps = {ast.Add: ("+=", "-="), ast.Sub: ("-=", "+="), ast.Mult: ("*=", "/=")}
        if type(node.op) in swaps:
            self.between(node.target, node.value, *swaps[type(node.op)], "operator")
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        words, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.between(left, right, words, other, "and/or")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        start, stop = self.begin(node), self.begin(node.operand)
        if isinstance(node.op, ast.Not):
            self.add(start, stop, "", "dropped not")
        elif isinstance(node.op, ast.USub):
            self.add(start, start + 1, "+", "sign")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value, start, stop = node.value, self.begin(node), self.end(node)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return
        if isinstance(value, int):
            self.add(start, stop, str(value + 1), "constant")
            if value:
                self.add(start, stop, str(value - 1), "constant")
        else:
            self.add(start, stop, f"{value + 1.0!r}" if value == 0.0 else f"{2.0 * value!r}",
                     "constant")  # fmt: skip

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(part)

    def visit_AsyncFunctionDef(self, node: ast.AsyncFunctionDef) -> None:
        self.visit_FunctionDef(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        """Words of an error are not looked at."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Nor those that are shown."""


def files() -> Iterator[Path]:
    for name in PLACES:
        place = ROOT / PACKAGE / name
        found = [place] if place.is_file() else sorted(place.rglob("*.py"))
        assert found, f"there is no {name} to mutate"
        yield from (path.relative_to(ROOT) for path in found if not LEFT_OUT.search(path.name))


def tests_of(path: Path) -> list[str]:
    """The tests for a module: those that name it or its folder first, the small ones first."""
    module = path.with_suffix("").parts[1:]
    words = set(re.findall("[a-z0-9]+", " ".join(module[2:])))

    def rank(test: Path) -> tuple[int, int, int]:
        text = test.read_text(encoding="utf-8")
        depths = range(len(module), 2, -1)
        named = (n for n in depths if re.search(rf"\b{re.escape('.'.join(module[:n]))}\b", text))
        return -next(named, 0), -len(words & set(test.stem.split("_"))), len(text)

    tests = sorted((ROOT / "tests" / module[1]).rglob("test_*.py"), key=rank)
    if module[1] == "links" and len(module) > 3:  # those of other links do not run it
        tests = [test for test in tests if module[2] in test.read_text(encoding="utf-8")]
    examples = [f"{EXAMPLES}[{'.'.join(module)}]"] if ">>> " in (ROOT / path).read_text() else []
    return [*(str(test.relative_to(ROOT)) for test in tests), *examples]


def copied(to: Path) -> None:
    """What the tests read: package, tests, pages and the few files at the root."""
    skipped = shutil.ignore_patterns("target", ".git", ".venv*", "_build", "__pycache__", "dist")
    shutil.copytree(ROOT, to, ignore=skipped, symlinks=True)


def verdict(tree: Path, tests: list[str], seconds: int) -> tuple[str, str]:
    """What tests say of the copy: 'survived', 'killed' by which test, or 'out of time'.

    They run in a fork of this process, which has imported the libraries and not the package.
    """
    output = tree.parent / "output.txt"
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        code = BROKEN
        try:
            os.setsid()  # so that the processes of its tests can be ended with it
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
            resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
            signal.alarm(5 * seconds)  # ends a test that waits for ever
            os.chdir(tree)
            # The package of the copy, not the one that is installed, compiled once.
            os.environ["PYTHONPATH"] = str(tree / "python")
            os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
            sys.dont_write_bytecode = False
            sys.path.insert(0, str(tree / "python"))
            stream = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(stream, 1)
            os.dup2(stream, 2)
            code = int(pytest.main(["-n", "0", "-x", "-q", "-p", "no:cacheprovider", *tests]))
            sys.stdout.flush()
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    if -code in LIMITS:
        return "out of time", ""
    text = output.read_text(encoding="utf-8", errors="replace")
    if code == BROKEN or code == pytest.ExitCode.USAGE_ERROR:
        sys.exit(text)
    by = re.search(r"^(?:FAILED|ERROR) ([^\s[]+)", text, re.MULTILINE)
    return ("survived", "") if code == 0 else ("killed", by[1] if by else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=int, default=200, help="processor time for one mutant")
    parser.add_argument("--only", metavar="PLACE", help="only files that begin so, as links/safety")
    parser.add_argument("--at", metavar="FILE:LINE", help="all mutants of one line instead")
    given = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as tests/conftest.py, which comes later
    for library in LIBRARIES:
        importlib.import_module(library)
    every = [one for path in files() for one in Mutants(path, (ROOT / path).read_bytes()).found]
    if given.at:
        name, _, line = given.at.rpartition(":")
        chosen = [one for one in every if str(one.path).endswith(name) and one.line == int(line)]
    else:
        every = [one for one in every if str(one.path).startswith(f"{PACKAGE}/{given.only or ''}")]
        chosen = random.Random(given.seed).sample(every, min(given.mutants, len(every)))
    print(f"{len(chosen)} of {len(every)} mutants", flush=True)
    counts: Counter[str] = Counter()
    sound: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        copied(tree)
        for number, mutant in enumerate(chosen, 1):
            file = tree / mutant.path
            source = file.read_bytes()
            file.write_bytes(mutant.apply(source))
            # Compiled code is found by the size of its source and the second it was written in.
            os.utime(file, (number, number))
            found, by = verdict(tree, tests_of(mutant.path), given.seconds)
            file.write_bytes(source)
            if by and by not in sound:
                # A test that fails anyway would kill every mutant.
                if verdict(tree, [by], given.seconds)[0] == "killed":
                    sys.exit(f"{by} fails without any change: mend it first")
                sound.add(by)
            counts[found] += 1
            print(f"{number:4} {found:<11} {mutant.path}:{mutant.line}  {mutant.kind}  {by}")
            if found != "killed":
                print(f"      {mutant.shown(source)}")
            sys.stdout.flush()
    decided = counts["killed"] + counts["survived"]
    print(f"{counts['killed']} of {decided} killed, {counts['out of time']} out of time")


if __name__ == "__main__":
    main()
