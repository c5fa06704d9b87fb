"""Independent work distributed over processes in batches, with progress and interrupts."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeVar

from deadtime._base.errors import WorkerError
from deadtime._base.progress import Progress, Report, reported
from deadtime._base.validation import whole_number

T = TypeVar("T")

#: Number of items below which starting other processes takes longer than the work.
FEW = 100

#: Largest number of items in a batch: larger ones cost less to hand over, smaller ones report
#: progress more often and are interrupted sooner.
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
    with reported(progress, count) as report:
        if workers == 1:
            return _here(task, batches, report)
        return _elsewhere(task, batches, report, workers)


def _here(task: Callable[[range], list[T]], batches: list[range], report: Report | None) -> list[T]:
    results: list[T] = []
    for batch in batches:
        results += task(batch)
        if report is not None:
            report(len(results))
    return results


def _elsewhere(
    task: Callable[[range], list[T]], batches: list[range], report: Report | None, workers: int
) -> list[T]:
    """Run batches in other processes; an interrupt waits for the running ones only."""
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _left_to_the_parent)
    try:
        with _interrupts_held_back():
            futures = {pool.submit(task, batch): i for i, batch in enumerate(batches)}
        found: dict[int, list[T]] = {}
        done = 0
        for future in as_completed(futures):
            found[futures[future]] = future.result()
            done += len(found[futures[future]])
            if report is not None:
                report(done)
    except BrokenProcessPool as error:
        raise WorkerError(
            "the worker processes could not start, or were killed. In a script, put the code "
            'under `if __name__ == "__main__":`. Or give processes=1'
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return [result for i in range(len(batches)) for result in found[i]]


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Delay Ctrl-C, and hide it from processes that start meanwhile.

    A terminal sends it to all its processes, and only the parent is to handle it. A new process
    inherits the signals that its parent has blocked.
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
    """Ignore Ctrl-C in a worker, where signals cannot be blocked; the parent handles it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
