"""What a design demands of its gains."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from deadtime._base.validation import finite, positive
from deadtime.loops import ControlLoop
from deadtime.tuning._margins import RequiredMargins

#: Bandwidth of the noise of a continuous loop, as a multiple of one over delay and lag, rad/s.
_BANDWIDTH = 100.0


@dataclass(frozen=True)
class Demands:
    """What must hold in every scenario; None where nothing is demanded."""

    margins: RequiredMargins
    max_sensitivity: float | None = None
    noise_gain: float | None = None
    settling_time: float | None = None
    bandwidth: float | None = None

    @classmethod
    def checked(
        cls,
        margins: RequiredMargins,
        max_sensitivity: float | None,
        noise_gain: float | None,
        settling_time: float | None,
        bandwidth: float | None,
    ) -> Demands:
        """Check the arguments of `design`."""
        if max_sensitivity is not None and not finite("max_sensitivity", max_sensitivity) > 1.0:
            raise ValueError(
                f"max_sensitivity={max_sensitivity}: in every loop with a delay Ms is above 1. "
                "Give a number such as 1.6"
            )
        given = {
            "noise_gain": noise_gain,
            "settling_time": settling_time,
            "bandwidth": bandwidth,
        }
        for name, value in given.items():
            if value is not None:
                positive(name, value)
        return cls(margins, max_sensitivity, noise_gain, settling_time, bandwidth)

    @property
    def beyond_margins(self) -> dict[str, float]:
        """Demands that are no margins, by name."""
        names = ("max_sensitivity", "noise_gain", "settling_time")
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    @property
    def named(self) -> dict[str, float]:
        """All of them by name."""
        return self.margins.named | self.beyond_margins

    def without(self, name: str) -> Demands:
        """The others."""
        if name in self.margins.named:
            return replace(self, margins=self.margins.without(name))
        nothing: dict[str, Any] = {name: None}
        return replace(self, **nothing)


def white_to(loop: ControlLoop, bandwidth: float | None = None) -> float:
    """Up to where measurement noise is taken for white, rad/s."""
    if loop.sample_time is not None:
        half = math.pi / loop.sample_time
        if bandwidth is not None and bandwidth > half:
            raise ValueError(
                f"bandwidth={bandwidth}: noise above {half:.4g} rad/s, half the sampling rate, "
                "appears at lower frequencies in the samples. Give the noise as it is in the "
                "samples"
            )
        return half if bandwidth is None else bandwidth
    if bandwidth is not None:
        return bandwidth
    late = (loop.delay or 0.0) + loop.parameters.get("lag", 0.0)
    return _BANDWIDTH / (late or 1.0)


def half_range(loop: ControlLoop) -> float:
    """Half of the range of the command; inf without a limit, or with one on one side alone."""
    low, high = loop.specification.bounds
    return 0.5 * (high - low)


def limit_in_words(loop: ControlLoop) -> str:
    """The limit of the command: one number where both bounds are alike."""
    low, high = loop.specification.bounds
    return f"{high:g}" if high == -low else f"{low:g} to {high:g}"
