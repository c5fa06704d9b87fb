"""Ctrl-C while modules are imported, and SIGTERM in a command that has something to keep."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

#: Exit code after Ctrl-C.
INTERRUPTED = 130

#: What a command says when Ctrl-C ends it.
SAID = "deadtime: interrupted"


@contextmanager
def ended_by_ctrl_c() -> Iterator[None]:
    """End the process at once on Ctrl-C; nothing is lost while modules are imported.

    An exception in the middle of an import may become one of another kind, or be ignored.
    """
    plain = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not plain or threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(*_: object) -> None:
        os.write(2, f"{SAID}\n".encode())
        os._exit(INTERRUPTED)

    signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def without_waiting_for_threads() -> Iterator[None]:
    """End the process at once on Ctrl-C: Python would wait for what its threads still compute."""
    try:
        yield
    except KeyboardInterrupt:
        sys.stdout.flush()
        print(SAID, file=sys.stderr, flush=True)
        os._exit(INTERRUPTED)


@contextmanager
def sigterm_as_ctrl_c() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGTERM as well."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
