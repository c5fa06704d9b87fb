"""The clock of all times and ages on a link.

The clock of the event loop stops while a laptop sleeps, but for a vehicle that waits for commands
that time passes.
"""

from __future__ import annotations

import asyncio
import time

from deadtime.links.virtual_time import VirtualTimeLoop


def _counted() -> float:
    """Time since the machine was started, s, with its sleep where the system counts that."""
    if hasattr(time, "CLOCK_BOOTTIME"):  # Linux
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    if hasattr(time, "CLOCK_UPTIME_RAW"):  # macOS, whose CLOCK_MONOTONIC goes on in sleep
        return time.clock_gettime(time.CLOCK_MONOTONIC)
    return time.monotonic()


#: Difference of the two clocks when the program starts, s.
_OFFSET = _counted() - time.monotonic()


def now() -> float:
    """The clock of the running event loop, plus the time the machine slept since the program began.

    Returns
    -------
    float
        Time in s; in virtual time that of the virtual clock.

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
    return loop.time() if isinstance(loop, VirtualTimeLoop) else _counted() - _OFFSET
