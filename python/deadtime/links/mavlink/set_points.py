"""Set points, which expire: no old one is ever repeated.

Where no new one comes, a set point is repeated every `REPEAT` until it is `Limits.command_age` old;
then hovering is commanded, and after `Limits.landing_after` the flight is given up. The vehicle has
a time-out of its own beside this, for the case that this program ends or stands still.
"""

from __future__ import annotations

import math
from typing import Any

from deadtime._base.validation import finite
from deadtime.links.expiry import ExpiringCommand
from deadtime.links.mavlink.elsewhere import CommandedElsewhere
from deadtime.links.mavlink.point_messages import message_of
from deadtime.links.safety import Limits
from deadtime.links.vehicle import Echo, Motion

#: Time between two checks of its age, and between two set points where no new one comes, s.
CYCLE, REPEAT = 0.05, 0.1


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


class SetPoints(ExpiringCommand):
    """The set point of one vehicle, which is sent while it is guarded."""

    def __init__(self, limits: Limits) -> None:
        super().__init__(limits, HOVER)
        self._sent = 0.0
        self._elsewhere = CommandedElsewhere()

    def begin(self, now: float) -> None:
        """Send set points from now on, hovering first."""
        self.guarded = self.expired is None
        self._motion, self._given = HOVER, now
        self._elsewhere = CommandedElsewhere()

    def stop(self) -> None:
        """Send none any more."""
        self.guarded = False

    def give_up(self, reason: str) -> None:
        """Send none any more; the first reason is kept."""
        self.expired = self.expired or reason
        self.guarded = False

    def due(self, now: float) -> bool:
        """Whether one is to be sent."""
        return self.guarded and now - self._sent > REPEAT - 0.5 * CYCLE

    def message(self, target: tuple[int, int], now: float, ground: float) -> Any:
        """The set point as a message; `ground` is the down coordinate that heights count from."""
        self._sent = now
        self._elsewhere.sent(self._motion, now)
        return message_of(self._motion, target, now, ground)

    def are_not(self, echo: Echo) -> bool:
        """Whether the vehicle follows velocities that were not sent from here, by its echoes."""
        return self.guarded and self._elsewhere.heard(echo)
