"""Ranges of the numbers of a sampled loop, and the further delay that it bears.

Each end is the first loss of stability that `_sampled_march` meets. An end is infinite only where
none can come: the loop gain does not depend on the number, or stays below one on the unit circle
for every fraction of a sample, so that no delay turns it to -1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np

from deadtime.loops._model import LoopModel
from deadtime.loops._sampled_gain import SampledLoopGain
from deadtime.loops._sampled_march import Loss, first_loss

__all__ = ["SampledNumber", "further_delay"]

#: First step of a march, as a part of the value.
_FIRST_STEP = 1.0 / 16.0

#: Fractions of a sample at which the loop gain is looked at before any delay is said to be borne.
_FRACTIONS = 33

#: A largest gain this close to one is neither above nor below it.
_ROUNDING = 1e-12


class SampledNumber:
    """The loop gain over one named number, the others as in `values`."""

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
        """Whether the loop gain is the same whatever the number is."""
        if self.name in ("delay", "sample_time"):
            return False
        here = self._here
        size = abs(self.value) if self.value != 0.0 else 1.0
        there = (
            self._build({**self._values, self.name: self.value + part * size})
            for part in (0.37, 0.71)
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
    def bears_any_delay(self) -> bool:
        """Whether the loop gain stays below one on the circle, whatever the delay is.

        Raises
        ------
        ValueError
            If double precision does not tell.
        """
        period = self._values["sample_time"]
        model = self._here
        parts = np.unique(
            np.append(np.linspace(0.0, 1.0, _FRACTIONS), 1.0 - np.geomspace(1e-9, 0.1, 9))
        )
        gains = (SampledLoopGain.of(model, part * period, period) for part in parts)
        largest = max(float(np.abs(gain.at(gain.corners)).max()) for gain in gains)
        if abs(largest - 1.0) <= _ROUNDING:
            raise ValueError(
                "the largest loop gain over all frequencies is one, to rounding: whether a delay "
                "makes this loop unstable is beyond double precision; change a gain by a little"
            )
        return largest < 1.0

    @property
    def _scale(self) -> float:
        return self._values["sample_time"] if self.name == "delay" else 1.0

    def _jumps(self, low: float, high: float) -> tuple[float, ...]:
        """Values at which a command arrives at the very sample, if that is read at once."""
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
        """A step that a mode of the plant does not swing through unseen."""
        if self.name != "delay":
            return math.inf
        fastest = float(np.abs(np.linalg.eigvals(self._here.A).imag).max(initial=0.0))
        period = self._values["sample_time"]
        return 0.25 / fastest if fastest * period > 0.5 else math.inf


def further_delay(number: SampledNumber) -> tuple[float, float]:
    """How much more delay a stable loop bears, and the frequency in rad/s it then swings at."""
    if number.bears_any_delay:
        return math.inf, math.nan
    found = number.loss(math.inf)
    assert found is not None  # only a finite end can be reached
    return found.value - number.value, found.angle / number.gain(found.value).sample_time
