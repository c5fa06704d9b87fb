"""What every estimation method is: a frozen object that holds its options."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from deadtime._base.validation import finite
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._runs import Run

__all__ = ["Method", "check_choice", "check_initial_output"]


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
    """

    name: ClassVar[str]
    joint: ClassVar[bool] = False

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
