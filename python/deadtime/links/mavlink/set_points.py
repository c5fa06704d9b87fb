"""Velocity set points, which expire: no old one is ever repeated.

A set point is repeated every `CYCLE` in case one is lost, until it is `Limits.command_age` old;
then hovering is commanded, and after `Limits.landing_after` the flight is given up. The vehicle has
a time-out of its own beside this, for the case that this program ends or stands still.
"""

from __future__ import annotations

from typing import Any

from deadtime.links.mavlink.codec import dialect
from deadtime.links.safety import Limits

#: Time between two set points, s.
CYCLE = 0.05

#: Velocities are followed; positions, accelerations and yaw are not given.
VELOCITY_ONLY = 0x0DC7

#: Frame of the set points: north, east, down.
LOCAL_NED = 1


class SetPoints:
    """The set point of one vehicle.

    Attributes
    ----------
    guarded : bool
        Whether set points are sent, and missing ones end the flight.
    expired : str or None
        Why the flight was given up.
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.guarded = False
        self.expired: str | None = None
        self._climb = 0.0
        self._given = self._sent = 0.0

    def begin(self, now: float) -> None:
        """Send set points from now on, hovering first."""
        self.guarded = self.expired is None
        self._climb, self._given = 0.0, now

    def stop(self) -> None:
        """Send none any more."""
        self.guarded = False

    def give_up(self, reason: str) -> None:
        """Send none any more; the first reason is kept."""
        self.expired = self.expired or reason
        self.guarded = False

    def command(self, climb: float, now: float) -> None:
        """Take a new vertical speed, m/s, up positive."""
        self.age(now)
        self._climb, self._given = climb, now

    def age(self, now: float) -> None:
        """Let the set point expire."""
        age = now - self._given
        if self.guarded and age > self.limits.command_age:
            self._climb = 0.0
        if self.guarded and age > self.limits.landing_after:
            self.give_up(f"no command for {age:.2f} s: the vehicle was commanded to land")

    def due(self, now: float) -> bool:
        """Whether one is to be sent."""
        return self.guarded and now - self._sent > 0.9 * CYCLE

    def message(self, target: tuple[int, int], now: float) -> Any:
        """The set point as a message."""
        self._sent = now
        zero = 0.0
        return dialect().MAVLink_set_position_target_local_ned_message(
            round(1e3 * now) % 2**32, *target, LOCAL_NED, VELOCITY_ONLY,
            zero, zero, zero, zero, zero, -self._climb, zero, zero, zero, zero, zero,
        )  # fmt: skip
