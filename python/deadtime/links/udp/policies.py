"""Policies of the plant for late and missing commands.

A policy decides how long a command waits before it is applied, by the age of the measurement that
it answers. A command that is older than the one in force is never applied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Protocol

from deadtime._base.validation import positive, whole_number

__all__ = ["DropLate", "HoldThenZero", "JitterBuffer", "NewestWins", "Policy"]


class Policy(Protocol):
    """Treatment of a command by the age of the measurement that it answers."""

    @property
    def needs_times(self) -> bool:
        """Whether the policy requires packets with time stamps."""

    @property
    def holds(self) -> int | None:
        """Sample times for which the last command holds; None until the watchdog."""

    @property
    def oldest(self) -> float:
        """Largest accepted age, s."""

    def wait(self, age: float) -> float | None:
        """Wait before the command is applied, s; None if it is too late."""


@dataclass(frozen=True)
class NewestWins:
    """Apply a command on arrival, unless a newer one was applied."""

    needs_times: ClassVar[bool] = False
    holds: ClassVar[int | None] = None
    oldest: ClassVar[float] = math.inf

    def wait(self, age: float) -> float | None:
        """No wait."""
        return 0.0


@dataclass(frozen=True)
class DropLate:
    """Do not apply commands that answer too old a measurement.

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
        """Largest accepted age, s."""
        return self.older_than

    def wait(self, age: float) -> float | None:
        """No wait, or None for a command that is too old."""
        return 0.0 if age <= self.older_than else None


@dataclass(frozen=True)
class HoldThenZero:
    """Hold the last command for some sample times; then apply zero.

    Parameters
    ----------
    samples : int
        Number of sample times.
    """

    samples: int
    needs_times: ClassVar[bool] = False
    oldest: ClassVar[float] = math.inf

    def __post_init__(self) -> None:
        whole_number("samples", self.samples)

    @property
    def holds(self) -> int | None:
        """Sample times for which the last command holds."""
        return self.samples

    def wait(self, age: float) -> float | None:
        """No wait."""
        return 0.0


@dataclass(frozen=True)
class JitterBuffer:
    """Apply every command at the same age of its measurement, which makes the delay constant.

    Later commands are not applied. The constant delay is as long as that of the latest commands
    that are still applied.

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
        """Largest accepted age, s."""
        return self.delay

    def wait(self, age: float) -> float | None:
        """The rest of the delay, or None for a command that is too late."""
        left = self.delay - age
        # An age equal to the delay up to rounding is in time.
        return max(0.0, left) if left >= -1e-9 else None
