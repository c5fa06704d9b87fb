"""Independent work shared out among processes, in batches, with progress and a clean Ctrl-C."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeAlias, TypeVar

from deadtime._base.errors import MissingExtraError, WorkerError
from deadtime._base.validation import whole_number

__all__ = ["Progress", "shared_out"]

T = TypeVar("T")

#: Called with the numbers of items that are done and of all items; True for a bar.
Report: TypeAlias = Callable[[int, int], object]
Progress: TypeAlias = bool | Report

#: Fewer items than this are done before other processes have started.
FEW = 100

#: Items of one batch, at most: so often progress is reported, and so many an interrupt waits for.
BATCH = 10


def shared_out(
    task: Callable[[range], list[T]], count: int, processes: int | None, progress: Progress
) -> list[T]:
    """Results of `task`, which pickles, for the items 0 to `count` - 1, in their order."""
    workers = os.cpu_count() or 1
    if processes is not None:
        workers = whole_number("processes", processes)
    elif count < FEW:
        workers = 1
    size = max(1, min(BATCH, count // (4 * workers)))
    batches = [range(start, min(start + size, count)) for start in range(0, count, size)]
    with _reporting(progress, count) as report:
        if workers == 1:
            return _here(task, batches, report, count)
        return _elsewhere(task, batches, report, count, workers)


def _here(
    task: Callable[[range], list[T]], batches: list[range], report: Report, count: int
) -> list[T]:
    results: list[T] = []
    for batch in batches:
        results += task(batch)
        report(len(results), count)
    return results


def _elsewhere(
    task: Callable[[range], list[T]], batches: list[range], report: Report, count: int, workers: int
) -> list[T]:
    """Batches on other processes; an interrupt waits for those that are at work and no others."""
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _left_to_the_parent)
    try:
        with _interrupts_held_back():
            futures = {pool.submit(task, batch): i for i, batch in enumerate(batches)}
        found: dict[int, list[T]] = {}
        done = 0
        for future in as_completed(futures):
            found[futures[future]] = future.result()
            done += len(found[futures[future]])
            report(done, count)
    except BrokenProcessPool as error:
        raise WorkerError(
            "the other processes cannot start or were killed: in a script, keep what it "
            'does under `if __name__ == "__main__":`, or give processes=1'
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return [result for i in range(len(batches)) for result in found[i]]


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C waits, and processes that start meanwhile never see one.

    It goes to every process of a terminal, and only the one that asked is to answer. A process
    that starts cannot say so in time, but takes over what its parent has blocked.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _left_to_the_parent() -> None:
    """Where nothing can be blocked, leave Ctrl-C to the parent from the first batch on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _reporting(progress: Progress, count: int) -> Iterator[Report]:
    """What to call with the numbers of items done and of all items."""
    if callable(progress):
        yield progress
        return
    if not progress:
        yield lambda done, total: None
        return
    try:
        from rich import progress as bars
    except ImportError as error:
        raise MissingExtraError(
            "a progress bar needs rich: install it with pip install 'deadtime[cli]', or give a "
            "function as progress"
        ) from error
    with bars.Progress(transient=True) as bar:
        task = bar.add_task("done", total=count)
        yield lambda done, total: bar.update(task, completed=done)
