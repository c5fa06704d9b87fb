"""The loops of a problem that differ in their gains, as the kernel judges many of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from deadtime.loops import ControlLoop
from deadtime.roots import ParametricQuasiPolynomial
from deadtime.tuning._native import Candidates, Family, LinearLoop

#: Values of the unknown numbers of a loop, by name.
Scenario = dict[str, float]


class Goal(NamedTuple):
    """What is made best, and the margins that are required; as the kernel takes it."""

    objective: str
    required: tuple[float, float, float]
    #: The size of the objective.
    scale: float


class Gathered:
    """Loops with any values of their free gains, for the kernel.

    Parameters
    ----------
    loop : ControlLoop
    free : tuple of str
        Gains that are sought.
    names : tuple of str
        Numbers that a scenario has.
    """

    def __init__(self, loop: ControlLoop, free: tuple[str, ...], names: tuple[str, ...]) -> None:
        self.loop, self.names = loop, names
        fixed = tuple(name for name in loop.controller.gains if name not in free)
        self.gains = (*free, *fixed)
        self._numbers = loop.parameters
        self._given = [self._numbers[name] for name in fixed]
        self._kept_shares: dict[tuple[float, ...], list[LinearLoop]] = {}
        self._kept: dict[tuple[tuple[float, ...], ...], Candidates] = {}

    def at(self, scenarios: Sequence[Scenario]) -> Candidates:
        """The loops in these scenarios."""
        values = [tuple([one[name] for name in self.names]) for one in scenarios]
        key = tuple(values)
        if key not in self._kept:
            self._kept[key] = self._gathered(values)
        return self._kept[key]

    def _gathered(self, values: list[tuple[float, ...]]) -> Candidates:
        place, first = self.names.index("delay"), len(self.gains)
        kinds: dict[tuple[float, ...], int] = {}
        rows = []
        for each in values:
            # The equations of a sampled loop do not depend on its delay.
            rest = each[:place] + each[place + 1 :]
            kind = kinds.setdefault(rest, len(kinds))
            lag = dict(zip(self.names, each, strict=True)).get("lag", self._numbers.get("lag", 0.0))
            rows.append(([*self._given, *each], kind, lag + (self.loop.sample_time or 0.0)))
        of = list(map(self._shares, kinds)) if self.loop.is_sampled else self._function
        return Candidates(of, first, first + place, rows)

    @cached_property
    def _function(self) -> Family:
        """The characteristic function of a continuous loop."""
        every = (*self.gains, *self.names)
        return ParametricQuasiPolynomial._of(every, self.loop._family_of(every)._terms)._family

    def _shares(self, rest: tuple[float, ...]) -> list[LinearLoop]:
        """The sampled loops with one gain of one and the others of zero."""
        if rest not in self._kept_shares:
            others = [name for name in self.names if name != "delay"]
            numbers = dict(zip(others, rest, strict=True)) | dict.fromkeys(self.gains, 0.0)
            kernel_at = self.loop.specification.kernel_at
            loops = [kernel_at(numbers | {name: 1.0}).linear for name in self.gains]
            self._kept_shares[rest] = loops
        return self._kept_shares[rest]
