"""Every message of the package on one page, for somebody who reads them in one go.

    python tests/house/messages.py [--over WORDS] [--place TEXT]

A message is a string that is raised or warned of, or a longer one that reads as a sentence; in the
kernel, a string of some words. ``{…}`` stands for a value. With `--over` only messages that have a
sentence of more words are listed.
"""

from __future__ import annotations

import argparse
import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYTHON = ROOT / "python/deadtime"
RUST = (ROOT / "rust/core/src", ROOT / "rust/bindings/src", ROOT / "rust/wire/src")

#: Most words of a sentence.
MOST = 25

#: Fewest words of a string that is read as a sentence where nothing raises it.
FEWEST = 5

#: Comments of the kernel, and reasons of its lints.
NO_MESSAGE = re.compile(r"^[ \t]*//.*$|reason = \"[^\"]*\"|'(?:\\.|[^'\\])'", re.MULTILINE)

#: A string of the kernel.
STRING = re.compile(r'"((?:[^"\\]|\\.)*)"', re.DOTALL)

#: Strings that are no sentences: code, styles, patterns, formats.
NO_SENTENCE = re.compile(
    r"[<>\\{}|]{2}|^\s*[.#@/-]|::|=>|^[a-z_]+\(|;\s*$|\bpx\b|^[A-Z]{3}[A-Z_ -]+"
)


@dataclass(frozen=True)
class Message:
    """One message: where it stands, and what it says."""

    place: str
    text: str

    @property
    def longest(self) -> int:
        """Words of its longest sentence."""
        sentences = re.split(r"(?<=[.!?])\s+|\n|; |: ", self.text)
        return max((len(re.findall(r"[^\s–-]+", one)) for one in sentences), default=0)


def _text(node: ast.expr) -> str | None:
    """The string of an expression, ``{…}`` for each value in it; None where it is none."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if isinstance(node, ast.JoinedStr):
        return "".join(
            part.value if isinstance(part, ast.Constant) and isinstance(part.value, str) else "{…}"
            for part in node.values
        )
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        parts = _text(node.left), _text(node.right)
        if any(parts):
            return "".join("{…}" if part is None else part for part in parts)
    return None


def _docstrings(tree: ast.AST) -> set[int]:
    """Strings that are statements: docstrings."""
    return {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}


def of_python(path: Path) -> Iterator[Message]:
    """The messages of a file of the package."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = _docstrings(tree)
    raised = {
        id(argument)
        for node in ast.walk(tree)
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
        for argument in node.exc.args
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.expr) or id(node) in inside:
            continue
        text = _text(node)
        if text is None:
            continue
        inside |= {id(part) for part in ast.walk(node) if part is not node}
        words = len(text.split())
        if id(node) in raised or (words >= FEWEST and not NO_SENTENCE.search(text)):
            yield Message(f"{path.relative_to(ROOT)}:{node.lineno}", text.strip())


def of_rust(path: Path) -> Iterator[Message]:
    """The sentences in a file of the kernel."""
    source = path.read_text(encoding="utf-8").partition("#[cfg(test)]")[0]
    source = NO_MESSAGE.sub(lambda found: " " * len(found[0]), source)
    for found in STRING.finditer(source):
        text = re.sub(r"\\\n\s*", "", found[1])
        if len(text.split()) >= FEWEST:
            line = source.count("\n", 0, found.start()) + 1
            place = f"{path.relative_to(ROOT)}:{line}"
            yield Message(place, re.sub(r"\{[^{}]*\}", "{…}", text))


def messages() -> list[Message]:
    """All messages, by place."""
    found = [one for path in sorted(PYTHON.rglob("*.py")) for one in of_python(path)]
    for folder in RUST:
        for path in sorted(folder.rglob("*.rs")):
            if path.name != "tests.rs":
                found += of_rust(path)
    return found


def main() -> None:
    """Print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--over", type=int, default=0, metavar="WORDS")
    parser.add_argument("--place", default="", metavar="TEXT")
    asked = parser.parse_args()
    for one in messages():
        if one.longest > asked.over and asked.place in one.place:
            print(f"{one.place}\n    {one.text}")


if __name__ == "__main__":
    main()
