"""The exceptions of the package, which carry the evidence.

Bad arguments are `ValueError` or `TypeError`; everything else derives from `DeadtimeError`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


class DeadtimeError(Exception):
    """Base of every error that `deadtime` raises for other reasons than a bad argument."""

    def __reduce__(self) -> tuple[Any, ...]:
        # By default an exception is made anew from its message alone, which drops its evidence or
        # fails; in a pool of processes such a failure hides the error itself.
        return _revived, (type(self), self.args, self.__dict__)


def _revived(kind: type[DeadtimeError], args: tuple[Any, ...], state: Any) -> DeadtimeError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class CertificateError(DeadtimeError):
    """A certificate does not prove what it says: the message names the first false claim."""


class ConvergenceError(DeadtimeError):
    """An iteration used up its budget.

    Attributes
    ----------
    best : complex
        The last iterate.
    """

    def __init__(self, message: str, best: complex = complex("nan")) -> None:
        super().__init__(message)
        self.best = best


class ContourError(DeadtimeError):
    """A root lies on the edge of a region, or too close to it to tell the side.

    Attributes
    ----------
    place : complex
        Where on the contour.
    distance : float
        How far to move the edge at least.
    inside : int or None
        The number of roots proved to lie inside and clear of the edge, where it is known.
    on_edge : list of (complex, float, int)
        Centre, radius and number of roots of each disc that meets the edge, where they are known.
    """

    def __init__(
        self,
        message: str,
        place: complex,
        distance: float,
        inside: int | None = None,
        on_edge: Sequence[tuple[complex, float, int]] = (),
    ) -> None:
        super().__init__(message)
        self.place = place
        self.distance = distance
        self.inside = inside
        self.on_edge = list(on_edge)


class CountMismatchError(DeadtimeError):
    """Roots counted and roots located disagree.

    Attributes
    ----------
    counted : int
        The number of roots by the argument principle.
    found : list of (complex, int)
        The roots that were located, with their multiplicities.
    """

    def __init__(self, message: str, counted: int, found: Sequence[tuple[complex, int]]) -> None:
        super().__init__(message)
        self.counted = counted
        self.found = list(found)


class NotIdentifiableError(DeadtimeError):
    """The recording does not determine what was asked for; the message names why."""


class NotProvedError(DeadtimeError):
    """No proof was found, and nothing is returned without one; the message says what to change."""


class RecordingError(DeadtimeError, ValueError):
    """A recording cannot be used as it is; the message says what is wrong and where."""

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class MissingExtraError(DeadtimeError, ImportError):
    """An optional package is not installed; the message holds the line that installs it."""


class WorkerError(DeadtimeError, RuntimeError):
    """Worker processes cannot start, or were killed."""


class LinkError(DeadtimeError):
    """A link to a vehicle or to the other end of a loop cannot be made, or was lost."""


class PacketError(LinkError, ValueError):
    """Bytes that are no valid packet; the message says what is wrong and at which offset."""


class FlightAbortedError(LinkError):
    """A safety rule has ended a flight.

    Attributes
    ----------
    reason : str
        Which rule, with the value that broke it.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def printable(text: str) -> str:
    r"""Text that may come from a file, in one line: escapes stand for what cannot be printed.

    >>> print(printable("Quad\nrotor \x1b[2J"))
    Quad\nrotor \x1b[2J
    """
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)
