"""Gains that are best in the worst case, by exchange.

    min over gains of max over scenarios p of cost(gains; p), margins(gains; p) >= asked for all p

has infinitely many p: every delay of an interval. The exchange method takes a few (ends and
middles), finds the best gains for those, looks over the whole interval for a p that is worse,
adds it, and repeats until there is none (Hettich and Kortanek, "Semi-infinite programming", SIAM
Review 35, 1993). The margins of the search are estimates: a demand that the exact margins miss is
raised by what is missing, in the same rounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from deadtime.tuning._demands import Demands, exact_margins
from deadtime.tuning._objectives import NEVER
from deadtime.tuning._problem import Scenario, Vector
from deadtime.tuning._result import LeastMargins
from deadtime.tuning._search import Search
from deadtime.tuning._worst import fine, worst_scenario

__all__ = ["Found", "best_gains", "least_margins"]

#: Rounds of the exchange; two or three do where nothing jumps, and where it does more are no use.
_ROUNDS = 12
_ROUNDS_SIMULATED = 5

#: The search aims so much above a demand, relatively, and what it then misses is made up for.
_ABOVE = 1e-5
_MISSED = 1e-12

#: A round that gains less, relatively, is the last: where roots meet at some delay, the worst case
#: has cusps in the delay that no few scenarios hold down for good.
_STALLED = 1e-3

#: A shortfall of margins by the estimate that no further round makes up for.
_HOPELESS = 3e-3


@dataclass(frozen=True, eq=False)
class Found:
    """Gains, the scenarios they are the best for, and what they are worth in the worst."""

    gains: Vector
    scenarios: tuple[Scenario, ...]
    cost: float
    worst: Scenario
    checked: int


def best_gains(search: Search, demands: Demands, start: Vector | None = None) -> Found:
    """The best gains in the worst scenario of all, from the map or from around a start."""
    problem, objective = search.problem, search.objective
    scenarios = list(problem.corners)
    aimed = demands.times(1.0 + _ABOVE)
    if start is None:
        gains = search.globally(scenarios, aimed)
    else:
        gains = search.locally(start, scenarios, aimed)
    best: Found | None = None
    for _ in range(_ROUNDS_SIMULATED if objective.simulated else _ROUNDS):
        if demands.asked and search.short(gains, scenarios, aimed) > _HOPELESS:
            break
        everywhere = [*fine(problem), *scenarios[len(problem.corners) :]]
        cost, worst = worst_scenario(problem, objective, gains, everywhere)
        seen = objective.worst(problem, gains, scenarios)
        added = [worst] if cost > seen + objective.tolerance * abs(seen) else []
        missing = np.zeros(3)
        if demands.asked:
            places = [*fine(problem, margins=True), *scenarios[len(problem.corners) :]]
            each = exact_margins(problem, gains, places)
            missing = np.maximum(demands.vector * (1.0 - _MISSED) - least_margins(each), 0.0)
            missing = np.where(demands.vector > 0.0, missing, 0.0)
            added += [places[int(np.argmin(each[:, i]))] for i in np.flatnonzero(missing)]
        stalled = best is not None and cost > best.cost - _STALLED * abs(best.cost)
        if not missing.any() and (best is None or cost < best.cost):
            best = Found(gains, tuple(scenarios), cost, worst, len(everywhere))
        added = [one for one in added if one not in scenarios]
        if not missing.any() and (stalled or not added):
            break
        scenarios += [one for i, one in enumerate(added) if one not in added[:i]]
        aimed = aimed.raised(missing)
        gains = search.locally(gains, scenarios, aimed)
    if best is None:
        raise _unmet(search, demands, gains)
    if best.cost >= NEVER:
        raise ValueError(
            f"a step of {problem.amplitude:g} does not settle with any gains that were tried: the "
            "limit may not let the output stay there; give a smaller amplitude, or another "
            "objective"
        )
    return replace(best, scenarios=tuple(scenarios))


def least_margins(each: Vector) -> Vector:
    """Least of margins (scenarios, 3); none at all where a scenario is not stable."""
    return np.asarray(np.where(np.isnan(each), 0.0, each).min(axis=0))


def _unmet(search: Search, demands: Demands, gains: Vector) -> ValueError:
    """The error that says that the demands are not met, and what can be had."""
    problem = search.problem
    points = search.survey.points[search.survey.stable]
    alone = search.estimate.of(points, problem.corners).max(axis=0)
    short = demands.shortfall(search.estimate.of(points, problem.corners))
    candidates = [gains, points[int(np.argmin(short))]]
    least = [least_margins(exact_margins(problem, one, problem.corners)) for one in candidates]
    place = int(np.argmin([demands.shortfall(one) for one in least]))
    wanted = ", ".join(f"{n} margin {_with_unit(n, v)}" for n, v in demands.asked.items())
    most = ", ".join(
        f"{name} {_with_unit(name, value)}"
        for name, value in zip(LeastMargins._fields, alone, strict=True)
        if name in demands.asked
    )
    nearest = ", ".join(
        f"{name} {_with_unit(name, value)}"
        for name, value in zip(LeastMargins._fields, least[place], strict=True)
    )
    at = ", ".join(f"{n} = {v:.4g}" for n, v in problem.named(candidates[place]).items())
    return ValueError(
        f"no gains in the ranges have {wanted}: taken alone, the most to be had is {most}; "
        f"together the nearest is {nearest} at {at}. Ask for less, or widen the ranges"
    )


def _with_unit(name: str, value: float) -> str:
    number = "without end" if math.isinf(value) else f"{value:.4g}"
    return number + {"gain": "", "phase": "°", "delay": " s"}[name]
