"""Policies of the plant for late and missing commands.

A policy decides how long a command waits before it is applied, by the age of the measurement that
it answers. A command that is older than the one in force is never applied.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from deadtime._base.validation import positive, whole_number


class Policy:
    """Treatment of a command by the age of the measurement that it answers."""

    #: Whether the policy requires packets with time stamps.
    needs_times: ClassVar[bool] = False

    @property
    def holds(self) -> int | None:
        """Sample times for which the last command holds; None until the watchdog."""
        return None

    @property
    def oldest(self) -> float:
        """Largest accepted age, s."""
        return math.inf

    def wait(self, age: float) -> float | None:
        """Wait before the command is applied, s; None if it is too late."""
        return 0.0


@dataclass(frozen=True)
class NewestWins(Policy):
    """Apply a command on arrival, unless a newer one was applied."""


@dataclass(frozen=True)
class DropLate(Policy):
    """Do not apply commands that answer too old a measurement.

    Parameters
    ----------
    older_than : float
        Largest age of the measurement, s.
    """

    older_than: float
    needs_times: ClassVar[bool] = True

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
class HoldThenZero(Policy):
    """Hold the last command for some sample times; then apply zero.

    Parameters
    ----------
    samples : int
        Number of sample times.
    """

    samples: int

    def __post_init__(self) -> None:
        whole_number("samples", self.samples)

    @property
    def holds(self) -> int | None:
        """Sample times for which the last command holds."""
        return self.samples


@dataclass(frozen=True)
class JitterBuffer(Policy):
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
