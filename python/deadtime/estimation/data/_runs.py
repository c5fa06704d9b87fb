"""One recording or several, each with its loop and its window."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

from deadtime._base.validation import OpenRange, is_range, open_interval
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

__all__ = ["Loops", "Recordings", "Run", "Windows", "paired_runs"]

#: One recording, or several of the same vehicle.
Recordings: TypeAlias = Recording | Sequence[Recording]

#: One loop for all recordings, or one for each.
Loops: TypeAlias = ControlLoop | Sequence[ControlLoop]

#: The part to use: one window for all recordings, or a list of them, one for each.
Windows: TypeAlias = OpenRange | list[OpenRange | None] | None


class Run(NamedTuple):
    """One recording, the loop that made it, and the part to use."""

    recording: Recording
    loop: ControlLoop
    window: OpenRange = (None, None)


def paired_runs(recording: Recordings, loop: Loops, window: Windows = None) -> list[Run]:
    """Pair recordings with loops and windows; a single loop or window applies to all."""
    recordings = list(recording) if isinstance(recording, (list, tuple)) else [recording]
    if not recordings:
        raise ValueError("no recording was given: give one, or a list of them")
    number = len(recordings)
    loops = list(loop) if isinstance(loop, (list, tuple)) else [loop] * number
    windows: list[Any] = [window] * number
    if isinstance(window, (tuple, list)) and not (is_range(window) and len(window) == 2):
        windows = list(window)
    for name, given in (("loop", loops), ("window", windows)):
        if len(given) != number:
            raise ValueError(
                f"{number} recordings and {len(given)} of `{name}`: give one for all, or one each"
            )
    runs = []
    for index, (one, its_loop, ends) in enumerate(zip(recordings, loops, windows, strict=True)):
        if not isinstance(one, Recording):
            raise TypeError(f"recording[{index}] must be a Recording, got {type(one).__name__}")
        if not isinstance(its_loop, ControlLoop):
            raise TypeError(f"loop[{index}] must be a ControlLoop, got {type(its_loop).__name__}")
        runs.append(Run(one, its_loop, _checked(ends)))
    plants = {type(run.loop.plant).__name__ for run in runs}
    if len(plants) > 1:
        raise ValueError(
            f"the loops have different plants ({', '.join(sorted(plants))}): recordings that are "
            "fitted together must be of one vehicle"
        )
    return runs


def _checked(window: OpenRange | None) -> OpenRange:
    open_interval("window", window)
    low, high = (None, None) if window is None else window
    return low, high
