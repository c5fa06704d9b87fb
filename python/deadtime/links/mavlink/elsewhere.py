"""Velocities that a vehicle follows although they were not sent from here.

ArduPilot reports the velocity of the set point that it follows, unshaped. It is one that was sent
from here in the last seconds, or zero where set points expired, unless somebody else sends some.
"""

from __future__ import annotations

from collections import deque

from deadtime.links.mavlink.belief import SURE, SURE_AFTER
from deadtime.links.mavlink.points import Point
from deadtime.links.vehicle import Echo, Motion

#: Time for which a set point may still be followed and reported, s.
FOLLOWED = 2.0

#: Difference of a velocity that counts as the same, m/s: messages are single precision.
SAME_SPEED = 1e-3


class CommandedElsewhere:
    """Compares the echoes of a vehicle with the set points that were sent.

    Examples
    --------
    >>> seen = CommandedElsewhere()
    >>> seen.sent(Motion(up=0.2), 0.0)
    >>> [seen.heard(Echo(t, t, 0.0, 0.0, up)) for t, up in [(2.5, 0.0), (2.6, 0.9), (2.7, 0.9)]]
    [False, False, False]
    >>> [seen.heard(Echo(t, t, 0.0, 0.0, 0.9)) for t in (2.8, 2.9)]
    [False, True]
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[float, Point]] = deque()
        self._since = float("inf")
        self._others: deque[float] = deque()

    def sent(self, point: Point, time: float) -> None:
        """Note a set point that is sent at a time, s."""
        self._since = min(self._since, time)
        self._sent.append((time, point))
        while self._sent[0][0] < time - FOLLOWED:
            self._sent.popleft()

    def heard(self, echo: Echo) -> bool:
        """Whether this echo and others of the last second are of velocities from elsewhere."""
        while self._sent and self._sent[0][0] < echo.time - FOLLOWED:
            self._sent.popleft()
        sent = [point for _, point in self._sent if isinstance(point, Motion)]
        unknown = len(sent) < len(self._sent) or echo.time < self._since + FOLLOWED
        if unknown or any(_same(echo, motion) for motion in (Motion(), *sent)):
            return False
        self._others.append(echo.time)
        while self._others[0] < echo.time - SURE_AFTER:
            self._others.popleft()
        return len(self._others) >= SURE


def _same(echo: Echo, motion: Motion) -> bool:
    pairs = ((echo.north, motion.north), (echo.east, motion.east), (echo.up, motion.up))
    return all(said is None or abs(said - own) < SAME_SPEED for said, own in pairs)
