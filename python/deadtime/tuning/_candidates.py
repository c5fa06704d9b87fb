"""What is not known of a loop, and the loops of the kernel with any values of it."""

from __future__ import annotations

from collections.abc import Sequence

from deadtime.loops import ControlLoop
from deadtime.tuning._native import Loop

#: Values of the unknown numbers of a loop, by name.
Scenario = dict[str, float]


class Gathered:
    """Loops in scenarios, for the kernel; each is made once."""

    def __init__(self, loop: ControlLoop, free: tuple[str, ...]) -> None:
        self.loop = loop
        names = [*loop.controller.gains]
        #: Places of the free gains.
        self.free = [names.index(name) for name in free]
        self._kept: dict[tuple[float, ...], Loop] = {}

    def at(self, scenarios: Sequence[Scenario]) -> list[Loop]:
        """The loops in these scenarios."""
        keys = [tuple(case.values()) for case in scenarios]
        new = {
            key: case for key, case in zip(keys, scenarios, strict=True) if key not in self._kept
        }
        if new:
            made = self.loop.specification.kernels_at([*new.values()])
            self._kept |= zip(new, made, strict=True)
        return [self._kept[key] for key in keys]
