"""Output on terminals that lack some characters: these are replaced by ASCII text."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

#: Replacements of characters for which `_spelled` has no rule, or a longer one.
INSTEAD = {
    "−": "-", "–": "-", "—": "-", "×": "x", "·": "*", "•": "*", "≤": "<=", "≥": ">=", "≈": "~",
    "±": "+-", "∞": "inf", "°": " deg", "→": "->", "⇒": "=>", "′": "'", "…": "...", "√": "sqrt",
    "²": "^2", "³": "^3", "¹": "^1", "⁻": "^-", "“": '"', "”": '"', "’": "'",
}  # fmt: skip


def make_readable() -> None:
    """Let standard output and standard error accept every character."""
    codecs.register_error("deadtime.readable", _instead)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="deadtime.readable")


def shows(text: str) -> bool:
    """Whether standard output can encode all these characters."""
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _instead(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    return "".join(map(_spelled, missing)), error.end


def _spelled(character: str) -> str:
    """A character in ASCII: from the table, by its name if Greek, else without its accents."""
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
