"""Results that do not change, also after they were pickled or copied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

__all__ = ["ReadOnlyArrays", "read_only"]


def read_only(value: Any) -> Any:
    """Make an array read-only, or every array among the values of a dict; return `value`."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, Mapping):
        for part in value.values():
            read_only(part)
    return value


class ReadOnlyArrays:
    """Base of classes whose arrays are read-only.

    NumPy forgets that an array is read-only when it is pickled or copied deeply, so the arrays
    of the copy are frozen again.
    """

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update({name: read_only(value) for name, value in state.items()})
