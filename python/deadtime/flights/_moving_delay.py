"""A delay that moves, for flights on an emulator: what a network does."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

from deadtime._base.validation import interval
from deadtime.links.clock import now

#: Parts of a move, as shares of its time: the rise from the first delay, and the fall back to it.
RISE, FALL = (0.2, 0.4), (0.6, 0.8)

#: Time between two changes, s.
EVERY = 0.05


class MovingDelay:
    """A delay of commands that goes from one to another and back once it is told to.

    Parameters
    ----------
    delays : (float, float)
        The first, and the longest, s.

    Examples
    --------
    >>> moving = MovingDelay((0.1, 0.5))
    >>> moving.start(10.0, duration=100.0)
    >>> [round(moving.at(time), 3) for time in (0.0, 30.0, 40.0, 60.0, 80.0, 100.0)]
    [0.1, 0.1, 0.3, 0.5, 0.3, 0.1]
    """

    def __init__(self, delays: tuple[float, float]) -> None:
        self.delays = interval("delays", delays)
        self._begin, self._duration = math.inf, 1.0

    def start(self, begin: float, duration: float) -> None:
        """Move from the time `begin` on, for `duration` seconds."""
        self._begin, self._duration = begin, duration

    def at(self, time: float) -> float:
        """The delay at a time, s."""
        passed = (time - self._begin) / self._duration
        up = (passed - RISE[0]) / (RISE[1] - RISE[0])
        down = (FALL[1] - passed) / (FALL[1] - FALL[0])
        low, high = self.delays
        return low + (high - low) * max(0.0, min(up, down, 1.0))

    async def drive(self, change: Callable[[float], None]) -> None:
        """Call `change` with the delay of now, until cancelled."""
        while True:
            change(self.at(now()))
            await asyncio.sleep(EVERY)
