"""Limits on the memory of a reader, and the errors of the libraries that read for it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from deadtime._base.errors import DeadtimeError, RecordingError
from deadtime.recordings._first_bytes import LARGEST_FILE

#: Largest size of what a file unpacks to, bytes: this much, and so many times the size of the file,
#: at most as much as the largest file.
#: Columns that hold still are packed a hundredfold; a file that promises more is damaged.
UNPACKED, FACTOR = 50_000_000, 100


def largest(size: int) -> int:
    """How many bytes a file of `size` bytes may hold unpacked."""
    return min(UNPACKED + FACTOR * size, LARGEST_FILE)


def check_numbers(path: object, size: int, count: int) -> None:
    """Refuse a file that says it holds more numbers than its size allows."""
    if 8 * count > largest(size):
        raise RecordingError(
            f"{path} has only {size} bytes, but should contain {count} numbers. The file is "
            "damaged, or compressed more than a hundredfold"
        )


@contextmanager
def errors_of(path: object, what: str) -> Iterator[None]:
    """Whatever a library raises on a file is one error, on one line."""
    try:
        yield
    except DeadtimeError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or "without a reason"
        raise RecordingError(
            f"{path} cannot be read as {what}, so it may be damaged or cut off: "
            f"{type(error).__name__}: {reason}"
        ) from error
