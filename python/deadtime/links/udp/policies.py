"""What the plant does with commands that come late, and with none.

A policy is asked how long a command is to wait before it is applied, by the age of the measurement
it answers. Whatever it says, a command that is older than one in force is never applied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Protocol

from deadtime._base.validation import positive, whole_number

__all__ = ["DropLate", "HoldThenZero", "JitterBuffer", "NewestWins", "Policy"]


class Policy(Protocol):
    """What is done with a command by the age of the measurement it answers."""

    @property
    def needs_times(self) -> bool:
        """Whether it works only where packets carry time stamps."""

    @property
    def holds(self) -> int | None:
        """Sample times that a command without a successor holds; None: until the watchdog."""

    @property
    def oldest(self) -> float:
        """Largest age that it bears, s."""

    def wait(self, age: float) -> float | None:
        """How long the command is to wait, s; None if it is late and not to be applied."""


@dataclass(frozen=True)
class NewestWins:
    """A command is applied as it comes, unless a newer one was."""

    needs_times: ClassVar[bool] = False
    holds: ClassVar[int | None] = None
    oldest: ClassVar[float] = math.inf

    def wait(self, age: float) -> float | None:
        """No time."""
        return 0.0


@dataclass(frozen=True)
class DropLate:
    """A command that answers a measurement older than this is not applied.

    Parameters
    ----------
    older_than : float
        Largest age of the measurement, s.
    """

    older_than: float
    needs_times: ClassVar[bool] = True
    holds: ClassVar[int | None] = None

    def __post_init__(self) -> None:
        positive("older_than", self.older_than)

    @property
    def oldest(self) -> float:
        """Largest age that it bears, s."""
        return self.older_than

    def wait(self, age: float) -> float | None:
        """No time, or None when it is too old."""
        return 0.0 if age <= self.older_than else None


@dataclass(frozen=True)
class HoldThenZero:
    """The last command holds for so many sample times; then the command is zero.

    Parameters
    ----------
    samples : int
        How many.
    """

    samples: int
    needs_times: ClassVar[bool] = False
    oldest: ClassVar[float] = math.inf

    def __post_init__(self) -> None:
        whole_number("samples", self.samples)

    @property
    def holds(self) -> int | None:
        """Sample times that a command without a successor holds."""
        return self.samples

    def wait(self, age: float) -> float | None:
        """No time."""
        return 0.0


@dataclass(frozen=True)
class JitterBuffer:
    """Every command waits until its measurement has one age: a random delay becomes a constant one.

    Commands that come later than that are not applied. The constant is the price: no command is
    earlier than the late ones that one still wants to have.

    Parameters
    ----------
    delay : float
        Age at which commands are applied, s.
    """

    delay: float
    needs_times: ClassVar[bool] = True
    holds: ClassVar[int | None] = None

    def __post_init__(self) -> None:
        positive("delay", self.delay)

    @property
    def oldest(self) -> float:
        """Largest age that it bears, s."""
        return self.delay

    def wait(self, age: float) -> float | None:
        """What is left of the delay, or None when nothing is."""
        left = self.delay - age
        # An age that is the delay but for rounding is in time.
        return max(0.0, left) if left >= -1e-9 else None
