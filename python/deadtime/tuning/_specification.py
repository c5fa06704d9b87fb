"""The arguments of `design` and `design_filter`, under their own names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from numpy.typing import ArrayLike

from deadtime._base.validation import Range
from deadtime.loops import Controller

__all__ = ["DesignSpecification", "FilterSpecification", "ObjectiveName"]

ObjectiveName: TypeAlias = Literal["abscissa", "damping", "settling_time", "overshoot"]


@dataclass(frozen=True, eq=False)
class DesignSpecification:
    """The arguments of `design`, which describes each."""

    controller: type[Controller] | Controller
    delay: float | Range | None
    gain: float | Range | None
    objective: ObjectiveName
    fixed: Mapping[str, float] | None
    gain_margin: float | None
    phase_margin: float | None
    delay_margin: float | None
    ranges: Mapping[str, Range] | None
    shape: Sequence[int] | None
    amplitude: float
    threads: int | None


@dataclass(frozen=True, eq=False)
class FilterSpecification:
    """The arguments of `design_filter` that are not those of `design`."""

    loss: float = 0.1
    noise: float | None = None
    command_noise: float | None = None
    omegas: ArrayLike | None = None
    damping: float = 1.0
    bandwidth: float | None = None
