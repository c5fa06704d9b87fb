"""The clock that every age on a link is read from.

The event loop's own clock stands still while a laptop sleeps; to a vehicle that waits for commands
that time has passed.
"""

from __future__ import annotations

import asyncio
import time

from deadtime.links.virtual_time import VirtualTimeLoop

__all__ = ["now"]


def _counted() -> float:
    """Time since the machine was started, its sleep included where the system counts that, s."""
    if hasattr(time, "CLOCK_BOOTTIME"):  # Linux
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    if hasattr(time, "CLOCK_UPTIME_RAW"):  # macOS, whose CLOCK_MONOTONIC goes on in sleep
        return time.clock_gettime(time.CLOCK_MONOTONIC)
    return time.monotonic()


#: What brings both clocks to the same reading when the program begins, s.
_AHEAD = _counted() - time.monotonic()


def now() -> float:
    """The running event loop's clock, and the time that the machine slept since the program began.

    Returns
    -------
    float
        s. In virtual time it is the virtual clock.

    Raises
    ------
    RuntimeError
        If no event loop runs.

    Examples
    --------
    >>> from deadtime import links
    >>> async def an_hour():
    ...     await asyncio.sleep(3600.0)
    ...     return now()
    >>> links.run(an_hour())
    3600.0
    """
    loop = asyncio.get_running_loop()
    return loop.time() if isinstance(loop, VirtualTimeLoop) else _counted() - _AHEAD
