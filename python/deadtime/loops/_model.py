"""The equations of a loop with numbers in the place of every parameter."""

from __future__ import annotations

from typing import NamedTuple

from deadtime._base.arrays import Array
from deadtime.loops._native import LinearLoop


class SampleUpdate(NamedTuple):
    """What a sample does to the states: x becomes J x + G w + H r."""

    states: Array
    command: Array
    reference: Array


class LoopModel(NamedTuple):
    """x' = A x + B w + E r, u = K x + L w + M r, y = C x + D w, w(t) = sat(u(t - Td)).

    The plant's states come first in x, the controller's after them.
    """

    A: Array
    B: Array
    E: Array
    K: Array
    L: float
    M: float
    C: Array
    D: float
    #: In u for each unit by which r jumps.
    impulse: float
    #: What a sample does to the states, where a discretised filter has some.
    update: SampleUpdate | None = None

    @classmethod
    def of(cls, loop: LinearLoop) -> LoopModel:
        """Read the equations of a loop."""
        equations, update = loop.equations()
        return cls(*equations)._replace(update=update and SampleUpdate(*update))

    def native(
        self, delay: float, sample_time: float | None = None, limit: float | None = None
    ) -> LinearLoop:
        """Return the loop as the stepper holds it."""
        return LinearLoop(self, delay, sample_time, limit)
