"""Gains that are best in the worst case, by exchange.

    min over gains of max over p of cost(gains; p), margins(gains; p) >= required for all p

has infinitely many p: every delay of an interval. The exchange method takes a few (ends and
middles), finds the best gains for those, looks over the whole interval for a p that is worse,
adds it, and repeats until there is none (Hettich and Kortanek, "Semi-infinite programming", SIAM
Review 35, 1993). The margins of the search are estimates: a requirement that the exact margins
miss is raised by what is missing, in the same rounds.

The look over the intervals is a search, not a proof: a fine grid of scenarios, and between the
neighbours of the worst of them a search along the delay; or the points around the region of an
estimate. Stability itself, the gain margin and the delay margin of a continuous loop are proved for
all of the intervals at once, by boxes: a gain margin of 2 is the stability of all plants up to
twice as strong, a delay margin that of all delays up to this margin longer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import ControlLoop
from deadtime.stability import proved_boxes
from deadtime.tuning._candidates import Scenario
from deadtime.tuning._margins import MARGINS, UNITS, RequiredMargins, exact_margins
from deadtime.tuning._objectives import NEVER, Objective
from deadtime.tuning._problem import Problem
from deadtime.tuning._search import Search
from deadtime.tuning._survey import surveyed

#: Most rounds of the exchange: two or three suffice where costs are continuous, and where steps are
#: simulated, which jump, more do not help.
_ROUNDS = 12
_ROUNDS_SIMULATED = 5

#: How far above a required margin the search aims, relatively: less needs more rounds.
_ABOVE = 1e-5
#: Relative shortfall of an exact margin that counts as rounding.
_MISSED = 1e-12

#: Relative improvement below which a round is the last: where roots meet at some delay, the worst
#: case has cusps in the delay, and a few scenarios never bound it exactly.
_STALLED = 1e-3

#: Estimated shortfall of the margins beyond which further rounds cannot meet them.
_HOPELESS = 3e-3

#: Values of each unknown number in a check, for one and two of them: of the objective, and of the
#: exact margins, which cost more.
_FINE = {1: 33, 2: 9}
_FINE_MARGINS = {1: 9, 2: 3}
#: Points of a region for each margin.
_LEAST = 2

#: Halvings of the way to gains that miss a margin: more end closer to them.
_HALVINGS = 40

#: Most boxes of a proof (bounds time).
_BOXES = 20_000


@dataclass(frozen=True, eq=False)
class Found:
    """Gains, the scenarios they are best for, and their cost in the worst of all scenarios."""

    gains: Array
    scenarios: tuple[Scenario, ...]
    cost: float
    worst: Scenario
    checked: int


def best_gains(search: Search, start: Array | None = None) -> Found:
    """The best gains in the worst scenario of all, from the map or from around a start."""
    problem, objective, required = search.problem, search.objective, search.required
    scenarios = list(problem.corners)
    search = replace(search, required=required.scaled(1.0 + _ABOVE), scenarios=tuple(scenarios))
    gains = search.globally() if start is None else search.locally(start)
    best: Found | None = None
    for _ in range(_ROUNDS_SIMULATED if objective.simulated else _ROUNDS):
        everywhere = [*fine(problem), *scenarios[len(problem.corners) :]]
        cost, worst = worst_scenario(problem, objective, gains, everywhere)
        seen = objective.worst(problem, gains, scenarios)
        added = [worst] if cost > seen + objective.tolerance * abs(seen) else []
        missing = underestimated = np.zeros(3)
        if required.named:
            places = [*margin_places(search, gains), *scenarios[len(problem.corners) :]]
            each = exact_margins(problem, gains, places, required)
            missing = _missing(required, each)
            added += [places[int(np.argmin(each[:, i]))] for i in np.flatnonzero(missing)]
            known = [one in scenarios for one in places]
            if any(known):
                underestimated = _missing(required, each[known])
        stalled = best is not None and cost > best.cost - _STALLED * abs(best.cost)
        if not missing.any() and (best is None or cost < best.cost):
            best = Found(gains, tuple(scenarios), cost, worst, len(everywhere))
        if missing.any() and search.short(gains) > _HOPELESS:
            break
        added = [one for one in added if one not in scenarios]
        if not missing.any() and (stalled or not added):
            break
        scenarios += [one for i, one in enumerate(added) if one not in added[:i]]
        aimed = search.required.raised(underestimated)
        search = replace(search, required=aimed, scenarios=tuple(scenarios))
        gains = search.locally(gains)
        if required.named and search.short(gains) > _HOPELESS:
            # Gains that have the margins in an added scenario may be far away.
            search = replace(search, survey=surveyed(problem, search.survey.shape, scenarios))
            gains = search.globally()
    if best is None:
        best = _just_inside(search, required, gains)
    if best is None:
        raise _unmet(search, required, gains)
    if best.cost >= NEVER:
        raise ValueError(
            f"a step of {problem.amplitude:g} does not settle with any gains that were tried: the "
            "limit may not let the output stay there; give a smaller amplitude, or another "
            "objective"
        )
    return replace(best, scenarios=tuple(scenarios))


def _just_inside(search: Search, required: RequiredMargins, gains: Array) -> Found | None:
    """The last gains that have the margins, on the way to gains that miss them by little.

    Where the best loop is deadbeat its cost falls without bound, whatever margin it misses.
    """
    problem, scenarios = search.problem, search.scenarios
    search = replace(search, required=required.scaled(1.0 + _ABOVE))
    points = search.survey.points[search.survey.stable]
    if not len(points) or search.short(gains) > _HOPELESS:
        return None
    inside, outside = points[int(np.argmin(search.shortfalls(points)))], gains
    if search.short(inside) > 0.0:
        return None
    for _ in range(_HALVINGS):
        middle = 0.5 * (inside + outside)
        if search.short(middle) > 0.0:
            outside = middle
        else:
            inside = middle
    if _missing(required, exact_margins(problem, inside, scenarios, required)).any():
        return None
    everywhere = [*fine(problem), *scenarios[len(problem.corners) :]]
    cost, worst = worst_scenario(problem, search.objective, inside, everywhere)
    return Found(inside, tuple(scenarios), cost, worst, len(everywhere))


def _missing(required: RequiredMargins, each: Array) -> Array:
    """What margins (scenarios, 5) miss of the requirements at their least."""
    missing = np.maximum(required.vector * (1.0 - _MISSED) - least_margins(each[:, :3]), 0.0)
    return np.where(required.vector > 0.0, missing, 0.0)


def least_margins(each: Array) -> Array:
    """Least of margins (scenarios, 3); none at all where a scenario is not stable."""
    return np.asarray(np.where(np.isnan(each), 0.0, each).min(axis=0))


def _unmet(search: Search, required: RequiredMargins, gains: Array) -> ValueError:
    """The error that names the requirements that are not met, and what is possible."""
    problem, scenarios = search.problem, search.scenarios
    points = search.survey.points[search.survey.stable]
    alone = (
        problem.candidates(scenarios).all_margins(points, problem.threads).min(axis=1).max(axis=0)
    )
    nearest = points[int(np.argmin(search.shortfalls(points)))]
    best = min([gains, nearest], key=search.short)
    least = least_margins(exact_margins(problem, best, scenarios)[:, :3])
    wanted = ", ".join(_with_unit(name, value) for name, value in required.named.items())
    most = ", ".join(
        _with_unit(name, value)
        for name, value in zip(MARGINS, alone, strict=True)
        if name in required.named
    )
    together = ", ".join(
        _with_unit(name, value) for name, value in zip(MARGINS, least, strict=True)
    )
    at = ", ".join(f"{n} = {v:.4g}" for n, v in problem.named(best).items())
    return ValueError(
        f"no gains in the ranges have {wanted}: taken alone, the most that can be reached is "
        f"{most}; together the nearest is {together} at {at}. Ask for less, or widen the ranges"
    )


def _with_unit(name: str, value: float) -> str:
    number = "without end" if math.isinf(value) else f"{value:.4g}"
    return f"{name.replace('_', ' ')} {number}{UNITS[name]}"


def fine(problem: Problem) -> tuple[Scenario, ...]:
    """The scenarios a design is checked in."""
    if problem.region is not None:
        return problem.region.points
    return problem.scenarios(_FINE.get(_unknown(problem), 1))


def margin_places(search: Search, gains: Array) -> tuple[Scenario, ...]:
    """Those its exact margins are computed in: of a region the points with the least estimates."""
    problem = search.problem
    if problem.region is None:
        return problem.scenarios(_FINE_MARGINS.get(_unknown(problem), 1))
    points = problem.region.points
    each = problem.candidates(points).all_margins(gains[None, :], problem.threads)[0]
    least = np.argsort(each, axis=0, kind="stable")[:_LEAST]
    return tuple(points[place] for place in np.unique(least))


def _unknown(problem: Problem) -> int:
    return sum(low < high for low, high in problem.intervals.values())


def worst_scenario(
    problem: Problem, objective: Objective, gains: Array, scenarios: Sequence[Scenario]
) -> tuple[float, Scenario]:
    """Cost of gains in the worst scenario, which may lie between those given, and that scenario."""
    costs = objective.costs(problem, gains[None, :], scenarios)[0]
    place = int(np.argmax(costs))
    worst, least = scenarios[place], float(costs[place])
    delays = sorted({one["delay"] for one in scenarios})
    at = delays.index(worst["delay"])
    low, high = delays[max(at - 1, 0)], delays[min(at + 1, len(delays) - 1)]
    if high > low and not objective.simulated and problem.region is None:
        of = problem.candidates(scenarios)
        late, cost = of.worst_delay(gains.tolist(), objective.name, place, (low, high))
        if cost > least:
            return cost, worst | {"delay": late}
    return least, worst


def proved(problem: Problem, gains: Array, required: RequiredMargins) -> tuple[str, ...]:
    """What of ``stable``, ``gain_margin``, ``delay_margin`` is proved for all of the intervals."""
    if problem.loop.is_sampled or problem.region is not None:
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
