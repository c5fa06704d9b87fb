"""Files of which a damaged length asks no more than they have."""

from __future__ import annotations

import os
from io import BufferedReader
from pathlib import Path
from typing import Any


class Bounded(BufferedReader):
    """A file whose reads are shortened to what is left, before memory is taken for them."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        super().__init__(open(path, "rb", buffering=0))  # noqa: SIM115 - closed with the reader
        self.size = os.fstat(self.fileno()).st_size

    def read(self, size: int | None = -1, /) -> bytes:
        left = max(0, self.size - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))


class BoundedPath(type(Path())):  # type: ignore[misc]
    """A path that opens as such a file, for a library that opens it itself."""

    def open(self, *_: Any, **__: Any) -> Bounded:
        """Open it for reading."""
        return Bounded(self)
