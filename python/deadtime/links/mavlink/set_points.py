"""Velocity set points, which expire: no old one is ever repeated.

Where no new one comes, a set point is repeated every `REPEAT` until it is `Limits.command_age` old;
then hovering is commanded, and after `Limits.landing_after` the flight is given up. The vehicle has
a time-out of its own beside this, for the case that this program ends or stands still.
"""

from __future__ import annotations

import math
from typing import Any

from deadtime._base.validation import finite
from deadtime.links.mavlink.codec import dialect
from deadtime.links.safety import Limits
from deadtime.links.vehicle import Motion

#: Time between two checks of its age, and between two set points where no new one comes, s.
CYCLE, REPEAT = 0.05, 0.1

#: Velocities are followed; positions and accelerations are not given, nor the heading. Without the
#: last bit a rate of turn is.
VELOCITY_ONLY, NO_TURN = 0x05C7, 0x0800

#: Frame of the set points: north, east, down.
LOCAL_NED = 1


def within(motion: Motion, limits: Limits) -> Motion:
    """The nearest motion that the limits allow; the direction on the ground is kept.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    for name, value in motion._asdict().items():
        if value is not None:
            finite(name, value)
    share = min(1.0, limits.max_speed / max(math.hypot(motion.north, motion.east), 1e-300))
    turn = None if motion.turn is None else _bounded(motion.turn, limits.max_yaw_rate)
    up = _bounded(motion.up, limits.max_climb)
    return Motion(share * motion.north, share * motion.east, up, turn)


def _bounded(value: float, most: float) -> float:
    return max(-most, min(most, value))


HOVER = Motion()


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
        self._motion = HOVER
        self._given = self._sent = 0.0

    def begin(self, now: float) -> None:
        """Send set points from now on, hovering first."""
        self.guarded = self.expired is None
        self._motion, self._given = HOVER, now

    def stop(self) -> None:
        """Send none any more."""
        self.guarded = False

    def give_up(self, reason: str) -> None:
        """Send none any more; the first reason is kept."""
        self.expired = self.expired or reason
        self.guarded = False

    def command(self, motion: Motion, now: float) -> None:
        """Take a new motion."""
        self.age(now)
        self._motion, self._given = motion, now

    def age(self, now: float) -> None:
        """Let the set point expire."""
        age = now - self._given
        if self.guarded and age > self.limits.command_age:
            self._motion = HOVER
        if self.guarded and age > self.limits.landing_after:
            self.give_up(f"no command for {age:.2f} s: the vehicle was commanded to land")

    def due(self, now: float) -> bool:
        """Whether one is to be sent."""
        return self.guarded and now - self._sent > REPEAT - 0.5 * CYCLE

    def message(self, target: tuple[int, int], now: float) -> Any:
        """The set point as a message."""
        self._sent = now
        zero, motion = 0.0, self._motion
        mask, turn = VELOCITY_ONLY, motion.turn
        if turn is None:
            mask, turn = mask | NO_TURN, zero
        return dialect().MAVLink_set_position_target_local_ned_message(
            round(1e3 * now) % 2**32, *target, LOCAL_NED, mask,
            zero, zero, zero, motion.north, motion.east, -motion.up, zero, zero, zero, zero, turn,
        )  # fmt: skip
