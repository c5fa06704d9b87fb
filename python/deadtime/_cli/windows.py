"""Files with a window of their own, such as ``flight.csv@13:25.5``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from deadtime._base.validation import OpenRange

#: A file and the two ends of its window, either of which may be left out.
_WITH_WINDOW = re.compile(r"(?P<file>.+)@(?P<low>[^@:]*):(?P<high>[^@:]*)")


def files_and_windows(
    given: Sequence[Path], window: OpenRange | None
) -> tuple[list[Path], list[OpenRange | None]]:
    """The files and their windows: `window` for those that have none of their own."""
    files, windows = [], []
    for path in given:
        found = None if path.exists() else _WITH_WINDOW.fullmatch(str(path))
        files.append(path if found is None else Path(found["file"]))
        windows.append(
            window if found is None else (_end(path, found["low"]), _end(path, found["high"]))
        )
    return files, windows


def _end(path: Path, text: str) -> float | None:
    if not text:
        return None
    try:
        return float(text)
    except ValueError:
        raise ValueError(
            f"{path}: {text!r} is not a time. To read only a part of a file, write "
            "FILE@LOW:HIGH with two times in s"
        ) from None
