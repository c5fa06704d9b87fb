"""The numbers in a message, by the paths of their fields."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

#: Longer arrays are images or scans and not signals; a covariance has 36 numbers.
LONGEST_ARRAY = 36

#: Deepest message, and most fields, that are listed.
DEEPEST, MOST = 12, 2000

#: A field, or a place in an array.
PART = re.compile(r"([^.\[\]]+)|\[(\d{1,9})\]")


def numbers_in(message: Any) -> list[str]:
    """The paths of all numbers, as ``"twist.linear.x"`` or ``"position[2]"``."""
    found = []
    for path, _ in _walk(message, "", 0):
        found.append(path)
        if len(found) == MOST:
            break
    return found


def _walk(value: Any, path: str, depth: int) -> Iterator[tuple[str, Any]]:
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        yield path, value
    elif depth == DEEPEST or isinstance(value, (str, bytes, bytearray)) or value is None:
        return
    elif isinstance(value, (Sequence, np.ndarray)):
        if len(value) <= LONGEST_ARRAY:
            for k, item in enumerate(value):
                yield from _walk(item, f"{path}[{k}]", depth + 1)
    else:
        for name, item in _named(value).items():
            yield from _walk(item, f"{path}.{name}" if path else name, depth + 1)


def _named(message: Any) -> Mapping[str, Any]:
    """The fields of a message of any of the libraries."""
    if isinstance(message, Mapping):
        return message
    found = getattr(message, "__slots__", None) or getattr(message, "__dict__", {})
    names = found if isinstance(found, (tuple, list)) else list(found)
    return {name: getattr(message, name, None) for name in names if not name.startswith("__")}


def number_at(message: Any, path: str) -> float:
    """The number at a path; NaN where the message has none."""
    value = message
    for name, place in PART.findall(path):
        if place:
            at = int(place)
            if isinstance(value, (str, bytes)) or not hasattr(value, "__len__"):
                return np.nan
            if at >= len(value):
                return np.nan
            value = value[at]
        else:
            value = _named(value).get(name)
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return np.nan


def stamp_of(message: Any) -> int | None:
    """The time in the header of a message, ns; None where it has none, or one that is not set."""
    stamp = _named(_named(message).get("header")).get("stamp")
    if stamp is None:
        return None
    parts = _named(stamp)
    seconds = parts.get("sec", parts.get("secs"))
    rest = parts.get("nanosec", parts.get("nsec", parts.get("nsecs", 0)))
    if not isinstance(seconds, (int, np.integer)) or not isinstance(rest, (int, np.integer)):
        return None
    return int(seconds) * 1_000_000_000 + int(rest) or None
