"""Maps of loops with a hold over two of their numbers, in rows along which a gain varies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops._native import HeldPlane
from deadtime.loops._specification import LoopSpecification, refuse_discretised


class Question(NamedTuple):
    """What is asked of every cell."""

    abscissa: bool
    decay: float
    damping: tuple[float, float] | None
    proof: str


def held_plane(
    loop: LoopSpecification, fixed: Mapping[str, float], axes: Mapping[str, Array]
) -> HeldPlane:
    """A sampled loop of which two numbers vary, and others are `fixed`."""
    refuse_discretised(loop.controller, 1.0, "a map")
    values = {**loop.parameters, **fixed}
    for name in ("delay", "sample_time"):
        low = float(np.min(axes.get(name, np.array(values[name]))))
        if low < 0.0 or (name == "sample_time" and low == 0.0):
            raise ValueError(
                f"{name}={low}: give delays of zero or more, and sample times above zero"
            )
    return loop.kernel_at(fixed).plane(dict(axes), loop.polynomials_of)
