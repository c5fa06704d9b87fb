"""Complete a landing although its task is cancelled, and keep what else went wrong as notes."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

from deadtime._base.errors import LinkError


def note(error: BaseException, *notes: str | None) -> None:
    """Add notes to an error."""
    for text in notes:
        if text is not None:
            error.add_note(text)


async def uninterrupted(landing: Coroutine[Any, Any, None]) -> None:
    """Complete a landing, which takes a bounded time, before a cancellation takes effect."""
    task = asyncio.ensure_future(landing)
    interrupted = False
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError:
            if task.cancelled():
                raise
            interrupted = True
        except LinkError:
            break
    if not interrupted:
        task.result()
        return
    cancelled = asyncio.CancelledError()
    problem = task.exception()
    if problem is not None:
        note(cancelled, str(problem), *getattr(problem, "__notes__", ()))
    raise cancelled
