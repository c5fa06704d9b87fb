"""Stable ranges of the numbers of a sampled loop other than gains and further delay.

Each end is the first loss of stability that `_sampled_march` finds. An end is infinite only if
the loop gain does not depend on the number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np

from deadtime.loops._model import LoopModel
from deadtime.loops._sampled_gain import SampledLoopGain
from deadtime.loops._sampled_march import Loss, first_loss

#: First step of a march, relative to the value: a larger one starts faster, but is refused sooner.
_FIRST_STEP = 1.0 / 16.0

#: Changes of a number, relative to it, for which the loop is compared to find whether it depends on
#: the number: any two that are not special values.
_CHANGES = (0.37, 0.71)

#: The fastest mode of the plant limits the steps of a delay if it turns by more than _SLOW radians
#: in a sample. It then turns by this angle in the longest step, in radians: a larger one is faster
#: and could miss an oscillation.
_SLOW = 0.5
_STEP_OF_MODE = 0.25


class SampledNumber:
    """The loop gain as a function of one named number; the others are those in `values`."""

    def __init__(
        self,
        build: Callable[[Mapping[str, float]], LoopModel],
        values: Mapping[str, float],
        name: str,
    ) -> None:
        self.name, self.value = name, values[name]
        self._build, self._values = build, values

        self._here = here = build(values)

        @lru_cache(maxsize=16)
        def gain(value: float) -> SampledLoopGain:
            numbers = {**values, name: value}
            model = here if name == "delay" else build(numbers)
            return SampledLoopGain.of(model, numbers["delay"], numbers["sample_time"])

        self.gain = gain

    @property
    def is_idle(self) -> bool:
        """Whether the loop gain does not depend on the number."""
        if self.name in ("delay", "sample_time"):
            return False
        here = self._here
        size = abs(self.value) if self.value != 0.0 else 1.0
        there = (
            self._build({**self._values, self.name: self.value + part * size}) for part in _CHANGES
        )
        return all(
            np.array_equal(getattr(here, matrix), getattr(other, matrix))
            for other in there
            for matrix in ("A", "B", "K", "L")
        )

    def loss(self, end: float) -> Loss | None:
        """The first loss of stability from the present value to `end`."""
        if end == self.value:
            return None
        step = _FIRST_STEP * (abs(self.value) if self.value != 0.0 else self._scale)
        return first_loss(
            self.gain, self.value, end, step, jumps=self._jumps, longest=self._longest
        )

    @property
    def _scale(self) -> float:
        return self._values["sample_time"] if self.name == "delay" else 1.0

    def _jumps(self, low: float, high: float) -> tuple[float, ...]:
        """Values at which a command arrives exactly at a sample and so affects its measurement."""
        delay, period = self._values["delay"], self._values["sample_time"]
        model = self._here
        if model.L == 0.0 or self.name not in ("delay", "sample_time"):
            return ()
        if self.name == "delay":
            first, last = math.floor(low / period) + 1, math.floor(high / period)
            return tuple(
                period * k for k in dict.fromkeys((first, last)) if low < period * k <= high
            )
        first, last = math.ceil(delay / high), math.ceil(delay / low) - 1
        return tuple(
            delay / k for k in dict.fromkeys((first, last)) if k > 0 and low < delay / k <= high
        )

    def _longest(self, value: float) -> float:
        """Longest step, short compared with the oscillation of the fastest mode of the plant."""
        if self.name != "delay":
            return math.inf
        fastest = float(np.abs(np.linalg.eigvals(self._here.A).imag).max(initial=0.0))
        period = self._values["sample_time"]
        return _STEP_OF_MODE / fastest if fastest * period > _SLOW else math.inf
