"""Text on terminals that cannot show all of it: what they lack is put in other characters."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

__all__ = ["make_readable", "shows"]

#: What stands for a character where its name says nothing shorter.
INSTEAD = {
    "−": "-", "–": "-", "—": "-", "×": "x", "·": "*", "•": "*", "≤": "<=", "≥": ">=", "≈": "~",
    "±": "+-", "∞": "inf", "°": " deg", "→": "->", "⇒": "=>", "′": "'", "…": "...", "√": "sqrt",
    "²": "^2", "³": "^3", "¹": "^1", "⁻": "^-", "“": '"', "”": '"', "’": "'",
}  # fmt: skip


def make_readable() -> None:
    """Have standard output and standard error take every character."""
    codecs.register_error("deadtime.readable", _instead)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="deadtime.readable")


def shows(text: str) -> bool:
    """Whether standard output has all these characters."""
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _instead(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(map(_spelled, lacking)), error.end


def _spelled(character: str) -> str:
    """A character in ASCII: by the table, a Greek letter by its name, others without accents."""
    if character in INSTEAD:
        return INSTEAD[character]
    name = unicodedata.name(character, "")
    if name.startswith("GREEK"):
        letter = name.split()[3] if name.split()[2:3] == ["LETTER"] else "?"
        return letter.lower() if "SMALL" in name else letter.capitalize()
    if name.startswith("BOX DRAWINGS"):
        return "|" if "VERTICAL" in name else "-"
    bare = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return bare or "?"
