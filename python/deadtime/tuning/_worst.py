"""The scenario in which given gains do worst, over whole intervals of delay and plant gain.

A fine grid of scenarios, and between the neighbours of the worst of them a search along the delay.
That is a search, not a proof. Stability itself, the gain margin and the delay margin of a
continuous loop are proved for all of the intervals at once, by boxes: a gain margin of 2 is the
stability of all plants up to twice as strong, a delay margin that of all delays up to this
margin longer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deadtime.loops import ControlLoop
from deadtime.stability import proved_boxes
from deadtime.tuning._objectives import Objective
from deadtime.tuning._problem import Problem, Scenario, Vector
from deadtime.tuning._required_margins import RequiredMargins

__all__ = ["fine", "proved", "worst_scenario"]

#: Values of each unknown number in a check, for one and two of them: of the objective, and of the
#: exact margins, which cost more.
_FINE = {1: 33, 2: 9}
_FINE_MARGINS = {1: 9, 2: 3}

#: Most boxes of a proof (bounds time).
_BOXES = 20_000


def fine(problem: Problem, margins: bool = False) -> tuple[Scenario, ...]:
    """The scenarios a design is checked in."""
    unknown = sum(low < high for low, high in problem.intervals.values())
    return problem.scenarios((_FINE_MARGINS if margins else _FINE).get(unknown, 1))


def worst_scenario(
    problem: Problem, objective: Objective, gains: Vector, scenarios: Sequence[Scenario]
) -> tuple[float, Scenario]:
    """Cost of gains in the worst scenario, which may lie between those given, and that scenario."""
    from scipy.optimize import minimize_scalar

    costs = objective.costs(problem, gains[None, :], scenarios)[0]
    place = int(np.argmax(costs))
    worst, least = scenarios[place], float(costs[place])
    delays = sorted({one["delay"] for one in scenarios})
    at = delays.index(worst["delay"])
    low, high = delays[max(at - 1, 0)], delays[min(at + 1, len(delays) - 1)]
    if high > low and not objective.simulated:
        found = minimize_scalar(
            lambda late: -objective.worst(problem, gains, [worst | {"delay": float(late)}]),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-6 * high},
        )
        if -found.fun > least:
            return float(-found.fun), worst | {"delay": float(found.x)}
    return least, worst


def proved(problem: Problem, gains: Vector, required: RequiredMargins) -> tuple[str, ...]:
    """What of ``stable``, ``gain_margin``, ``delay_margin`` is proved for all of the intervals."""
    if problem.loop.is_sampled:
        return ()
    loop = problem.at(gains)
    found = []
    delay, strong = problem.intervals["delay"], problem.intervals.get("gain")
    if _stable_throughout(loop, delay, strong):
        found.append("stable")
    if required.gain_margin:
        weak, most = strong or (loop.parameters["gain"],) * 2
        if weak > 0.0 and _stable_throughout(loop, delay, (weak, required.gain_margin * most)):
            found.append("gain_margin")
    if required.delay_margin and _stable_throughout(
        loop, (delay[0], delay[1] + required.delay_margin), strong
    ):
        found.append("delay_margin")
    return tuple(found)


def _stable_throughout(
    loop: ControlLoop, delay: tuple[float, float], strong: tuple[float, float] | None
) -> bool:
    ranges = {"delay": delay} | ({} if strong is None else {"gain": strong})
    moving = {name: ends for name, ends in ranges.items() if ends[0] < ends[1]}
    loop = loop.replace(**{name: ends[0] for name, ends in ranges.items()})
    if not moving:
        return loop.is_stable()
    boxes = proved_boxes(loop, moving, tol=0.0, max_boxes=_BOXES)
    return bool(np.all(boxes.unstable == 0))
