"""Ctrl-C and SIGTERM while something flies: both land it, and neither can interrupt the landing."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Coroutine, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, TypeVar

__all__ = ["run_landing", "terminated_like_interrupted"]

T = TypeVar("T")


def run_landing(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine that lands what it flies when it is cancelled.

    The first signal cancels it; later ones are answered by patience: landing takes a bounded time.

    Raises
    ------
    KeyboardInterrupt
        If a signal came.
    """
    stopped: list[int] = []

    async def guarded() -> T:
        loop = asyncio.get_running_loop()
        task = asyncio.current_task()
        assert task is not None

        def stop(number: int) -> None:
            if not stopped:
                task.cancel()
            print("deadtime: landing first", file=sys.stderr, flush=True)
            stopped.append(number)

        signals = (signal.SIGINT, signal.SIGTERM)
        for one in signals:
            loop.add_signal_handler(one, stop, one)
        try:
            return await main
        finally:
            for one in signals:
                loop.remove_signal_handler(one)

    try:
        return asyncio.run(guarded())
    except asyncio.CancelledError as cancelled:
        interrupt = KeyboardInterrupt()
        for note in getattr(cancelled, "__notes__", ()):  # such as a landing that nobody confirmed
            interrupt.add_note(note)
        raise interrupt from None


@contextmanager
def terminated_like_interrupted() -> Iterator[None]:
    """SIGTERM raises what Ctrl-C does, so that what was started is ended on the way out."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
