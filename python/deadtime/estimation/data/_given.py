"""What is given for all recordings, or one for each of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from deadtime._base.validation import is_range


def given_recordings(recording: Any) -> list[Any]:
    """The recordings, of which one may be given alone."""
    is_several = isinstance(recording, (list, tuple, Iterator))
    recordings = list(recording) if is_several else [recording]
    if not recordings:
        raise ValueError("no recording was given: give a recording, or a list of recordings")
    return recordings


def one_each(name: str, given: Any, number: int) -> list[Any]:
    """What was given for all recordings, or one each, as a list."""
    is_window = name == "window" and is_range(given) and len(given) == 2
    is_several = isinstance(given, (list, tuple)) and not is_window
    found = list(given) if is_several else [given] * number
    if len(found) != number:
        raise ValueError(
            f"{number} recordings and {len(found)} of `{name}`: give one for all, or one each"
        )
    return found
