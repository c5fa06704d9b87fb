"""The loops of a problem that differ in their gains, as the kernel judges many of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from deadtime.loops import ControlLoop
from deadtime.roots import ParametricQuasiPolynomial
from deadtime.tuning._native import Candidates, Family

#: Values of the unknown numbers of a loop, by name.
Scenario = dict[str, float]


class Goal(NamedTuple):
    """What is made best, and the margins that are required; as the kernel takes it."""

    objective: str
    required: tuple[float, float, float]
    #: The size of the objective.
    scale: float


def candidates(
    loop: ControlLoop, free: tuple[str, ...], scenarios: Sequence[Scenario]
) -> Candidates:
    """Loops with any values of the free gains, in these scenarios."""
    names, numbers = tuple(scenarios[0]), loop.parameters
    fixed = tuple(name for name in loop.controller.gains if name not in free)
    gains, given = (*free, *fixed), [numbers[name] for name in fixed]
    kinds: dict[tuple[float, ...], int] = {}
    rows = []
    for one in scenarios:
        # The equations of a sampled loop do not depend on its delay.
        rest = tuple(value for name, value in one.items() if name != "delay")
        kind = kinds.setdefault(rest, len(kinds))
        time = one.get("lag", numbers.get("lag", 0.0)) + (loop.sample_time or 0.0)
        rows.append(([*given, *(one[name] for name in names)], kind, time))
    of: Family | list[list[list[float]]]
    if loop.is_sampled:
        rests = [dict(zip((n for n in names if n != "delay"), rest, strict=True)) for rest in kinds]
        of = [_rows(loop, gains, rest) for rest in rests]
    else:
        every = (*gains, *names)
        of = ParametricQuasiPolynomial._of(every, loop._family_of(every)._terms)._family
    return Candidates(of, len(gains), len(gains) + names.index("delay"), rows)


def _rows(loop: ControlLoop, gains: Sequence[str], rest: Scenario) -> list[list[float]]:
    """The numbers of the loops with one gain of one and the others of zero."""
    specification = loop.specification
    numbers = specification.parameters | rest | dict.fromkeys(gains, 0.0)
    models = [specification.model_at(numbers | {name: 1.0}) for name in gains]
    return [model.row(numbers["delay"], loop.sample_time).tolist() for model in models]
