"""Between a process and the one that started it, which holds the other end of its standard input.

The system closes that end when its holder ends, in whatever way, by ``kill -9`` as well.
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
from contextlib import suppress


def parent_ended() -> asyncio.Event:
    """An event of the running loop that is set when standard input ends.

    What is read until then is discarded. Without a standard input it has ended already.
    """
    ended = asyncio.Event()
    if sys.stdin is None:  # its descriptor may belong to another file by now
        ended.set()
        return ended
    loop, number = asyncio.get_running_loop(), sys.stdin.fileno()

    def read() -> None:
        # Not by sys.stdin, whose lock this thread would hold when the interpreter ends.
        with suppress(OSError):
            while os.read(number, 4096):
                pass
        with suppress(RuntimeError):  # the loop may have ended
            loop.call_soon_threadsafe(ended.set)

    # A daemon thread, because the input may never end.
    threading.Thread(target=read, daemon=True).start()
    return ended


def first_line(process: subprocess.Popen[str], within: float) -> str:
    """The first line that a process prints; without one within so many seconds it is killed."""
    assert process.stdout is not None
    timer = threading.Timer(within, process.kill)  # which ends the read
    timer.start()
    try:
        return process.stdout.readline()
    finally:
        timer.cancel()
