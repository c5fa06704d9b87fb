"""Progress of long work: a function that is called, or a bar."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

#: Called now and then with the number of items that are done.
Report: TypeAlias = Callable[[int], object]

#: A function to call, or whether to show a bar.
Progress: TypeAlias = bool | Report

#: A function that is called with the name of each stage as it begins, or whether to print the
#: names.
Stages: TypeAlias = bool | Callable[[str], object]

#: Without a bar, a line is written each time this share of the items, or this factor where their
#: number is not known, has been added: few enough for a log file.
_SHARE, _FACTOR = 0.1, 2.0


@contextmanager
def reported(progress: Progress, total: int | None = None) -> Iterator[Report | None]:
    """Give the function to call with the number of items done; None where `progress` is False.

    True is a bar of rich or tqdm, whichever is installed, otherwise lines on stderr.
    """
    if not isinstance(progress, bool):
        if not callable(progress):
            raise TypeError(
                f"progress={progress!r}: give True for a bar, or a function that takes the "
                "number of finished parts"
            )
        yield progress
        return
    if not progress:
        yield None
        return
    try:
        from rich import progress as bars
        from rich.console import Console
    except ImportError:
        with _without_rich(total) as report:
            yield report
        return
    with bars.Progress(console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("done", total=total)
        yield lambda done: shown.update(task, completed=done)


def stage_report(progress: Stages) -> Callable[[str], object]:
    """The function to call with the name of each stage; True prints the names on stderr."""
    if isinstance(progress, bool):
        return _print_stage if progress else lambda stage: None
    if not callable(progress):
        raise TypeError(
            f"progress={progress!r}: give True to print the stages, or a function that takes "
            "the name of a stage"
        )
    return progress


def _print_stage(stage: str) -> None:
    print(stage, file=sys.stderr, flush=True)


@contextmanager
def _without_rich(total: int | None) -> Iterator[Report]:
    try:
        from tqdm import tqdm  # type: ignore[import-untyped, unused-ignore]
    except ImportError:
        yield _Lines(total)
        return
    with tqdm(total=total) as bar:
        yield lambda done: bar.update(done - bar.n)


class _Lines:
    """Lines on stderr, few however often it is called."""

    def __init__(self, total: int | None) -> None:
        self._total, self._next = total, 1.0

    def __call__(self, done: int) -> None:
        if done < self._next and done != self._total:
            return
        whole = "" if self._total is None else f" of {self._total}"
        print(f"{done}{whole} done", file=sys.stderr, flush=True)
        known = self._total is not None
        self._next = done + _SHARE * (self._total or 0) if known else _FACTOR * max(done, 1)
