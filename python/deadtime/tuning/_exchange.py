"""Gains that are best in the worst case, which the kernel finds in one call, and what is proved.

Stability itself, the gain margin and the delay margin of a continuous loop are proved for all of
the intervals at once, by boxes: a gain margin of 2 is the stability of all plants up to twice as
strong, a delay margin that of all delays up to this margin longer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import ControlLoop
from deadtime.stability import proved_boxes
from deadtime.tuning._candidates import Scenario
from deadtime.tuning._margins import MARGINS, UNITS, RequiredMargins
from deadtime.tuning._native import FoundGains, GainSearch, Loop
from deadtime.tuning._objectives import NEVER, SIMULATED
from deadtime.tuning._problem import ObjectiveName, Problem
from deadtime.tuning._survey import Survey

#: Values of each unknown number in a check, for one and two of them: of the objective, and of the
#: exact margins, which cost more.
_FINE = {1: 33, 2: 9}
_FINE_MARGINS = {1: 9, 2: 3}
#: Points of a region for each margin.
_LEAST = 2

#: Most boxes of a proof (bounds time).
_BOXES = 20_000


class Found(NamedTuple):
    """Gains, the scenarios they are best for, and their value in the worst of all scenarios."""

    gains: Array
    scenarios: list[tuple[int, float]]
    value: float
    worst: Scenario
    checked: int


class _Question(NamedTuple):
    """What the kernel looks for; scenarios by their places among the loops."""

    loops: list[Loop]
    free: list[int]
    corners: list[int]
    fine: list[int]
    places: list[int] | None
    objective: str
    required: tuple[float, float, float]
    amplitude: float
    axes: tuple[Array, ...]
    abscissa: Array
    threads: int | None


@dataclass(frozen=True, eq=False)
class Search:
    """A search for the gains that are best in the worst scenario, with the required margins."""

    problem: Problem
    objective: ObjectiveName
    survey: Survey
    required: RequiredMargins

    @cached_property
    def _fine(self) -> tuple[Scenario, ...]:
        return fine(self.problem)

    @cached_property
    def _exact(self) -> tuple[Scenario, ...]:
        return _margin_places(self.problem)

    @cached_property
    def _scenarios(self) -> list[Scenario]:
        """Each once: those it begins with, those it judges and those of exact margins."""
        problem = self.problem
        every = [problem.middle, *problem.corners, *self._fine, *self._exact]
        return [*{tuple(scenario.items()): scenario for scenario in every}.values()]

    def _places(self, scenarios: Sequence[Scenario]) -> list[int]:
        known = {tuple(scenario.items()): place for place, scenario in enumerate(self._scenarios)}
        return [known[tuple(scenario.items())] for scenario in scenarios]

    @cached_property
    def _native(self) -> GainSearch:
        problem, gathered = self.problem, self.problem.gathered
        is_region = problem.region is not None
        return GainSearch(
            _Question(
                loops=gathered.at(self._scenarios),
                free=gathered.free,
                corners=self._places(problem.corners),
                fine=self._places(self._fine),
                places=None if is_region else self._places(self._exact),
                objective=self.objective,
                required=self.required,
                amplitude=problem.amplitude,
                axes=self.survey.axes,
                abscissa=self.survey.abscissa,
                threads=problem.threads,
            )
        )

    def _scenario(self, spot: tuple[int, float]) -> Scenario:
        return self._scenarios[spot[0]] | {"delay": spot[1]}

    def best(self, start: Array | None = None) -> Found:
        """The best gains in the worst scenario of all, from the map or from around a start."""
        found = self._native.best(None if start is None else start.tolist())
        if not isinstance(found, FoundGains):
            raise _unmet(self, found.alone, found.gains, found.together)
        problem = self.problem
        if found.cost >= NEVER:
            raise ValueError(
                f"with all gains that were tried, a step of {problem.amplitude:g} does not "
                "settle. Perhaps the limit of the command does not allow this output. Give a "
                "smaller amplitude, or another objective"
            )
        worst = self._scenario(found.worst)
        return Found(np.array(found.gains), found.scenarios, found.value, worst, found.checked)

    def value_without(
        self, required: RequiredMargins, scenarios: list[tuple[int, float]] | None = None
    ) -> float:
        """The value of the best gains for some scenarios alone, or in the middle of all."""
        if scenarios is None:
            middle = self.problem.middle
            (place,) = self._places([middle])
            scenarios = [(place, middle["delay"])]
        return self._native.best_in(scenarios, required)

    def proved(self, found: Found) -> float:
        """The value, where it is simulated with a proof of what follows the simulated time."""
        if self.objective not in SIMULATED:
            return found.value
        problem = self.problem
        judged = [*self._fine, found.worst]
        places = zip(self._near(judged), judged, strict=True)
        spots = [(place, scenario["delay"]) for place, scenario in places]
        worst = found.value
        steps = self._native.proved_steps(spots, found.gains.tolist())
        for scenario, step in zip(judged, steps, strict=True):
            if step is None:
                case = ", ".join(f"{name} = {number:.6g}" for name, number in scenario.items())
                raise ValueError(
                    f"with {problem.named(found.gains)}, a step of {problem.amplitude:g} "
                    f"settles in simulation. But for {case}, no proof was found that the output "
                    "stays in the band. Require margins, or give another objective"
                )
            worst = max(worst, step[SIMULATED.index(self.objective)])
        return worst

    def _near(self, scenarios: Sequence[Scenario]) -> list[int]:
        """Places of loops that differ from these scenarios in the delay at most."""
        rest = [{**scenario, "delay": 0.0} for scenario in self._scenarios]
        return [rest.index({**scenario, "delay": 0.0}) for scenario in scenarios]


def _unmet(
    search: Search, alone: list[float], gains: list[float], together: list[float]
) -> ValueError:
    """The error that names the requirements that are not met, and what is possible."""
    required = search.required.named
    wanted = ", ".join(_with_unit(name, value) for name, value in required.items())
    pairs = zip(MARGINS, alone, strict=True)
    most = ", ".join(_with_unit(name, value) for name, value in pairs if name in required)
    nearest = ", ".join(map(_with_unit, MARGINS, together))
    at = ", ".join(f"{n} = {v:.4g}" for n, v in search.problem.named(gains).items())
    return ValueError(
        f"no gains in the ranges have {wanted}. Each requirement alone can reach at most "
        f"{most}. Together, the nearest is {nearest} at {at}. Require less, or give wider ranges"
    )


def _with_unit(name: str, value: float) -> str:
    number = "infinite" if math.isinf(value) else f"{value:.4g}"
    return f"{name.replace('_', ' ')} {number}{UNITS[name]}"


def fine(problem: Problem) -> tuple[Scenario, ...]:
    """The scenarios a design is checked in."""
    if problem.region is not None:
        return problem.region.points
    return problem.scenarios(_FINE.get(_unknown(problem), 1))


def _margin_places(problem: Problem) -> tuple[Scenario, ...]:
    if problem.region is not None:
        return ()
    return problem.scenarios(_FINE_MARGINS.get(_unknown(problem), 1))


def margin_places(problem: Problem, gains: Array) -> tuple[Scenario, ...]:
    """Those its exact margins are computed in: of a region the points with the least estimates."""
    if problem.region is None:
        return _margin_places(problem)
    points = problem.region.points
    each = problem.candidates(points).all_margins(gains[None, :], problem.threads)[0]
    least = np.argsort(each, axis=0, kind="stable")[:_LEAST]
    return tuple(points[place] for place in np.unique(least))


def _unknown(problem: Problem) -> int:
    return sum(low < high for low, high in problem.intervals.values())


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
