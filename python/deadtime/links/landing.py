"""Ctrl-C, SIGTERM and a closed terminal during a flight: the vehicle is landed first."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")

Stop: TypeAlias = Callable[[], None]

#: Signals that end a flight: Ctrl-C, a request to terminate, and a closed or lost terminal
#: (SIGBREAK on Windows). No system has all of them.
ENDING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


def run_landing(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine that lands its vehicle when it is cancelled.

    As `asyncio.run`, but Ctrl-C, SIGTERM and SIGHUP all cancel it. Further signals do not interrupt
    the landing, which takes a bounded time. A signal that the process ignores stays ignored.

    Parameters
    ----------
    main : coroutine
        What is run, in the main thread.

    Returns
    -------
    object
        What the coroutine returns.

    Raises
    ------
    KeyboardInterrupt
        If a signal was received.

    Examples
    --------
    >>> async def fly():
    ...     return "landed"
    >>> run_landing(fly())
    'landed'
    """

    async def guarded() -> T:
        loop = asyncio.get_running_loop()
        task = asyncio.current_task()
        assert task is not None

        def stop() -> None:
            task.cancel()
            with suppress(OSError):  # standard error may be closed
                print("deadtime: landing first", file=sys.stderr, flush=True)

        before = {sig: signal.getsignal(sig) or signal.SIG_DFL for sig in _handled_signals()}
        for sig in before:
            _handle(loop, sig, stop)
        try:
            return await main
        finally:
            for sig, handler in before.items():
                with suppress(NotImplementedError):
                    loop.remove_signal_handler(sig)
                signal.signal(sig, handler)

    try:
        return asyncio.run(guarded())
    except asyncio.CancelledError as cancelled:
        interrupt = KeyboardInterrupt()
        for note in getattr(cancelled, "__notes__", ()):  # for example an unconfirmed landing
            interrupt.add_note(note)
        raise interrupt from None


def _handle(loop: asyncio.AbstractEventLoop, number: signal.Signals, stop: Stop) -> None:
    """Call `stop` in the event loop when the signal is received."""
    try:
        loop.add_signal_handler(number, stop)
    except NotImplementedError:  # on Windows the interpreter handles it and calls the event loop
        signal.signal(number, lambda *_: loop.call_soon_threadsafe(stop))


@contextmanager
def terminated_like_interrupted() -> Iterator[None]:
    """Let the other signals raise KeyboardInterrupt, as Ctrl-C does, so that cleanup is done."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = {
        sig: signal.signal(sig, interrupt) for sig in _handled_signals() if sig != signal.SIGINT
    }
    try:
        yield
    finally:
        for sig, handler in before.items():
            signal.signal(sig, handler)


def _handled_signals() -> list[signal.Signals]:
    """The signals of this system that end a flight, except for ignored ones (as by ``nohup``)."""
    here = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    return [
        sig for sig in here if sig == signal.SIGINT or signal.getsignal(sig) is not signal.SIG_IGN
    ]
