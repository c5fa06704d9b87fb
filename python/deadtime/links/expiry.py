"""A command that expires: too old, it becomes hovering, and then the end of the flight."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from deadtime.links.safety import Limits


class ExpiringCommand(ABC):
    """The newest command of a flight.

    Attributes
    ----------
    guarded : bool
        Whether missing commands end the flight: in the air, not while taking off.
    expired : str or None
        Why the flight was given up.
    """

    def __init__(self, limits: Limits, rest: Any) -> None:
        self.limits = limits
        self.guarded = False
        self.expired: str | None = None
        self._rest = self._motion = rest
        self._given = 0.0

    @abstractmethod
    def give_up(self, reason: str) -> None:
        """End the flight; the first reason is kept."""

    def command(self, motion: Any, now: float) -> None:
        """Take a new motion."""
        self.age(now)
        self._motion, self._given = motion, now

    def hover(self, now: float) -> None:
        """Command no motion."""
        self.command(self._rest, now)

    def age(self, now: float) -> None:
        """Let the command expire."""
        age = now - self._given
        if self.guarded and age > self.limits.command_age:
            self._motion = self._rest
        if self.guarded and age > self.limits.landing_after:
            self.give_up(
                f"no command was given for {age:.2f} s, so the vehicle was commanded to land"
            )
