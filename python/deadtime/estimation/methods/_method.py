"""What every estimation method is, a frozen object that holds its options, and what it is given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, TypeAlias

from deadtime._base.validation import OpenRange, finite, open_interval
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._given import given_recordings, one_each
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording, RecordingCheck

#: One recording, or several of the same vehicle.
Recordings: TypeAlias = Recording | Sequence[Recording]

#: One loop for all recordings, or one for each.
Loops: TypeAlias = ControlLoop | Sequence[ControlLoop]

#: The part to use: one window for all recordings, or a list of them, one for each.
Windows: TypeAlias = OpenRange | list[OpenRange | None] | None


class Run(NamedTuple):
    """One recording, the loop that made it, the part to use, and what was found there.

    `corrected` says in words what of it has been put right.
    """

    recording: Recording
    loop: ControlLoop
    window: OpenRange = (None, None)
    check: RecordingCheck | None = None
    corrected: tuple[str, ...] = ()


def paired_runs(recording: Recordings, loop: Loops, window: Windows = None) -> list[Run]:
    """Pair recordings with loops and windows; a single loop or window applies to all."""
    recordings = given_recordings(recording)
    loops = one_each("loop", loop, len(recordings))
    windows = one_each("window", window, len(recordings))
    runs = []
    for index, (record, its_loop, ends) in enumerate(zip(recordings, loops, windows, strict=True)):
        if not isinstance(record, Recording):
            raise TypeError(f"recording[{index}] must be a Recording, not {type(record).__name__}")
        if not isinstance(its_loop, ControlLoop):
            raise TypeError(f"loop[{index}] must be a ControlLoop, not {type(its_loop).__name__}")
        open_interval("window", ends)
        low, high = (None, None) if ends is None else ends
        runs.append(Run(record.complete(), its_loop, (low, high)))
    plants = {type(run.loop.plant).__name__ for run in runs}
    if len(plants) > 1:
        raise ValueError(
            f"the loops have different plants ({', '.join(sorted(plants))}), "
            "but recordings that are fitted together must come from one vehicle"
        )
    return runs


@dataclass(frozen=True)
class Method(ABC):
    """A method of estimation with its options, for the `method` of `estimate_delay`.

    Attributes
    ----------
    name : str
        Short form of the object with its default options: ``method="waveform"`` means
        ``method=Waveform()``.
    joint : bool
        Whether it fits several recordings together.
    limits : str
        What biases it, in a sentence; empty for methods of maximum likelihood and least squares.
    """

    name: ClassVar[str]
    joint: ClassVar[bool] = False
    limits: ClassVar[str] = ""

    @abstractmethod
    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the runs; to exactly one unless the method is `joint`."""


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Refuse an option that is not one of its choices."""
    if value not in choices:
        raise ValueError(f"{name}={value!r} is not one of {', '.join(map(repr, choices))}")


def check_initial_output(value: float | None) -> None:
    """Refuse a known output at the start that is no finite number."""
    if value is not None:
        finite("initial_output", value)
