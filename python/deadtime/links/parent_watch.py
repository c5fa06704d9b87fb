"""Standard input as a lifeline: a process that was started by another one ends with it.

Whoever starts a process holds the other end of its standard input. The system closes that end when
its holder ends, however it does, by ``kill -9`` as well.
"""

from __future__ import annotations

import asyncio
import os
import sys
import threading
from contextlib import suppress

__all__ = ["input_ends"]


def input_ends() -> asyncio.Event:
    """An event of the running loop that is set at the end of standard input.

    What is read until then is thrown away. Without a standard input it has ended already.
    """
    ended = asyncio.Event()
    if sys.stdin is None:  # its number may be that of another file by now
        ended.set()
        return ended
    loop, number = asyncio.get_running_loop(), sys.stdin.fileno()

    def read() -> None:
        # Not by sys.stdin: at its end the interpreter wants a lock that this thread would hold.
        with suppress(OSError):
            while os.read(number, 4096):
                pass
        with suppress(RuntimeError):  # the loop may have ended before
            loop.call_soon_threadsafe(ended.set)

    # A daemon: nobody waits for input that may never end.
    threading.Thread(target=read, daemon=True).start()
    return ended
