"""Ctrl-C, SIGTERM and a closed terminal while something flies: they land it, and it stays so."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, TypeAlias, TypeVar

__all__ = ["run_landing", "terminated_like_interrupted"]

T = TypeVar("T")

Stop: TypeAlias = Callable[[], None]

#: What ends a flight: Ctrl-C, a polite kill, and a terminal that was closed or lost; SIGBREAK is
#: Windows' word for the last. Each system has some of them.
ENDING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


def run_landing(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine that lands what it flies when it is cancelled.

    Each signal cancels it. Landing is not interrupted by more of them; it takes a bounded time.

    Raises
    ------
    KeyboardInterrupt
        If a signal came.
    """

    async def guarded() -> T:
        loop = asyncio.get_running_loop()
        task = asyncio.current_task()
        assert task is not None

        def stop() -> None:
            task.cancel()
            with suppress(OSError):  # whoever read it may be gone
                print("deadtime: landing first", file=sys.stderr, flush=True)

        before = {one: signal.getsignal(one) or signal.SIG_DFL for one in _heeded()}
        for one in before:
            _handle(loop, one, stop)
        try:
            return await main
        finally:
            for one, handler in before.items():
                with suppress(NotImplementedError):
                    loop.remove_signal_handler(one)
                signal.signal(one, handler)

    try:
        return asyncio.run(guarded())
    except asyncio.CancelledError as cancelled:
        interrupt = KeyboardInterrupt()
        for note in getattr(cancelled, "__notes__", ()):  # such as a landing that nobody confirmed
            interrupt.add_note(note)
        raise interrupt from None


def _handle(loop: asyncio.AbstractEventLoop, number: signal.Signals, stop: Stop) -> None:
    """Call `stop` in the event loop when a signal comes."""
    try:
        loop.add_signal_handler(number, stop)
    except NotImplementedError:  # Windows: the interpreter takes it, and hands it on
        signal.signal(number, lambda *_: loop.call_soon_threadsafe(stop))


@contextmanager
def terminated_like_interrupted() -> Iterator[None]:
    """The other signals raise what Ctrl-C does, so that what was started is ended."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = {one: signal.signal(one, interrupt) for one in _heeded() if one != signal.SIGINT}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


def _heeded() -> list[signal.Signals]:
    """The signals that end; a closed terminal does not where `nohup` has had that ignored."""
    here = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    return [
        one for one in here if one == signal.SIGINT or signal.getsignal(one) is not signal.SIG_IGN
    ]
