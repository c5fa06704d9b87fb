"""The best gains for given scenarios: the best cells of the map, improved by a local search.

Every cost here has kinks, where two poles are equally far right or two delays equally bad, and the
best gains lie on them; simulated ones also jump, where a peak leaves the settling band. So nothing
is differentiated:

one gain   golden section and parabolas (Brent 1973) between the neighbours of the cell: the cost
           has one minimum there, kinked or not, if it does not jump;
more       grids around the best point, each narrower than the one before (a map or a sweep of
           hundreds of loops costs little more than one), and then, where nothing jumps, the
           simplices of Nelder and Mead (1965), begun again around what they found, smaller and
           turned: a simplex that has collapsed on a kink is so freed.

Simulated objectives are searched for the gains alone first, and in the last grids with gains half a
percent beside them. There a gain whose axis begins at zero stays a quarter of a cell away from it.

Margins are requirements, not costs: a shortfall costs many times as much as any gain in the
objective, and becomes zero where the requirements can be met. None of this proves a global minimum:
the map finds it as far as its cells are close enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np

from deadtime._base.arrays import Array, Indices
from deadtime.tuning._candidates import Goal, Scenario
from deadtime.tuning._margins import RequiredMargins
from deadtime.tuning._native import Candidates
from deadtime.tuning._objectives import NEVER, Objective
from deadtime.tuning._problem import Problem
from deadtime.tuning._survey import Survey, grid_points

#: Upper limits on the cells whose cost is computed where the map does not hold it, from poles or by
#: simulation (bound time).
_CELLS_BY_POLES = 150
_CELLS_SIMULATED = 450

#: Cells from which the local search starts; fewer where loops are simulated, and up to the third
#: number where the neighbours of the gains cost much more than these themselves.
_STARTS = 3
_STARTS_SIMULATED = 2
_MOST_STARTS = 6

#: Ratio of the cost with neighbouring gains to that of the best cell above which further starts are
#: tried.
_MUCH = 1.15

#: Points along each side of a grid, for one, two and three free gains, and half the width of the
#: first grid in cells of the map.
_SIDE = {1: 21, 2: 9, 3: 5}
_REACH = 1.5
#: Number of grids; of simulated loops, for the gains alone and then with their neighbours.
_GRIDS = 3
_GRIDS_SIMULATED = 8
_GRIDS_ROUNDED = 4
#: Ratio of the widths of two grids, and the part of the half width within which the best point must
#: lie for the grid to become narrower.
_NARROWER = 0.5
_ARRIVED = 0.55

#: Relative half width of the first grid around the best gains alone in which the best ones with
#: their neighbours are sought.
_NEAR = 0.03

#: Cells whose margins are computed at once, the best ones first: more of them may be in vain.
_TOGETHER = 64

#: Shortfall of the margins that counts as none.
_MET = 1e-6

#: Costs of rows of gains in scenarios.
Judge: TypeAlias = Callable[[Problem, Array, Sequence[Scenario]], Array]

Pair: TypeAlias = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Search:
    """A search for the gains that are best in some scenarios, with the required margins there."""

    problem: Problem
    objective: Objective
    survey: Survey
    required: RequiredMargins
    scenarios: Sequence[Scenario] = ()

    def globally(self) -> Array:
        """The best gains, from the map."""
        points, stable = self.survey.points, np.flatnonzero(self.survey.stable)
        costs = self._cell_costs(points, stable)
        if self.objective.simulated and np.isfinite(costs).any():
            return self._firmest(points, costs)
        starts = self.survey.chosen(points, costs, _STARTS)
        if not len(starts):
            # Perhaps the requirements are met between the cells.
            costs[stable] = self.shortfalls(points[stable])
            starts = self.survey.chosen(points, costs, 1)
        found = sorted(map(self._by_grids, starts), key=lambda one: self._total(one[0]))
        # With three gains a search may end on a kink far from the best.
        most = len(found) if len(self.problem.free) > 2 else 1
        return min((self._polished(*one) for one in found[:most]), key=self._total)

    def _cell_costs(self, points: Array, stable: Indices) -> Array:
        """Costs of the cells that meet the margins, infinite of the others.

        Where the map holds the costs, only as many of the best cells as the search begins from.
        """
        costs = np.full(len(points), np.inf)
        abscissa = self.survey.abscissa.ravel()
        if self.objective.name != "abscissa":
            met = stable[self.shortfalls(points[stable], _MET) <= _MET]
            if met.size:
                costs[met] = self._map_costs(met)
            return costs
        order = stable[np.argsort(abscissa[stable], kind="stable")]
        for first in range(0, len(order), _TOGETHER):
            cells = order[first : first + _TOGETHER]
            met = cells[self.shortfalls(points[cells], _MET) <= _MET]
            costs[met] = abscissa[met]
            if met.size and len(self.survey.chosen(points, costs, _STARTS)) == _STARTS:
                break
        return costs

    def _firmest(self, points: Array, costs: Array) -> Array:
        """The best gains with their neighbours, from more starts where those lose much by them."""
        for axes in self.survey.fringes:
            fringe = grid_points(axes)
            points = np.vstack([points, fringe])
            costs = np.append(costs, self._simulated(fringe, self.objective.coarse))
        starts = self.survey.chosen(points, costs, _MOST_STARTS)
        best, least = starts[0], np.inf
        for i, start in enumerate(starts):
            if i >= _STARTS_SIMULATED and least <= _MUCH * costs.min():
                break
            gains = self._by_grids(start)[0]
            cost = self._total(gains)
            if cost < least:
                best, least = gains, cost
        return np.asarray(best, dtype=np.float64)

    def locally(self, start: Array) -> Array:
        """The best gains around a start."""
        return self._polished(*self._by_grids(start))

    def _by_grids(self, start: Array) -> Pair:
        """A better point, and how far around it a better one may still be."""
        reach = _REACH * self.survey.spacing
        low, high = np.array(self.survey.bounds).T

        def narrowed(judge: Judge, around: Array, reach: Array, grids: int) -> Pair:
            return _by_grids(partial(self._least, judge=judge), around, reach, low, high, grids)

        if self.objective.simulated:
            # Neighbours count many times as much as the gains themselves, and decide little.
            low, high = self.survey.off_zero(start)
            start, _ = narrowed(self.objective.coarse, start, reach, _GRIDS_SIMULATED)
            reach = np.array(
                [min(_NEAR * abs(one), side) for one, side in zip(start, reach, strict=True)]
            )
            return narrowed(self.objective.costs, start, reach, _GRIDS_ROUNDED)
        if len(start) == 1 or self.objective.name == "damping":
            return start, reach
        return narrowed(self.objective.costs, start, reach, _GRIDS)

    def _polished(self, start: Array, reach: Array) -> Array:
        """The best point within reach, where costs are continuous."""
        if self.objective.simulated:
            return start
        bounds = self.survey.bounds
        return self._loops.best_within(self._goal, start.tolist(), reach.tolist(), bounds)

    def short(self, gains: Array) -> float:
        """By how much gains fall short of the required margins; infinite where not stable."""
        point = gains[None, :]
        stable = np.isfinite(self._loops.stable_abscissae(point, self.problem.threads)[0])
        return float(self.shortfalls(point)[0]) if stable else np.inf

    def shortfalls(self, points: Array, most: float = np.inf) -> Array:
        """The same of rows of gains that are stable; where more than `most`, perhaps too small."""
        return self._loops.shortfalls(points, self.required, most, self.problem.threads)

    def _total(self, gains: Array) -> float:
        """Cost of gains, shortfalls of margins included."""
        if self.objective.simulated:
            return float(self._simulated(gains[None, :], self.objective.costs)[0])
        return self._loops.total(gains.tolist(), self._goal)

    def _least(self, points: Array, judge: Judge) -> tuple[int, float]:
        """Place and cost of the best of the points."""
        if not self.objective.simulated:
            return self._loops.least(points, self._goal)
        costs = self._simulated(points, judge)
        place = int(np.argmin(costs))
        return place, float(costs[place])

    def _simulated(self, points: Array, judge: Judge) -> Array:
        """Costs of points, of which only those that may be taken are simulated."""
        costs = np.full(len(points), np.inf)
        late = self._loops.stable_abscissae(points, self.problem.threads)
        stable = np.flatnonzero(np.isfinite(late))
        good = stable[self.shortfalls(points[stable], _MET) <= _MET]
        if good.size:
            costs[good] = judge(self.problem, points[good], self.scenarios).max(axis=1)
        else:
            costs[stable] = NEVER * (1.0 + self.shortfalls(points[stable]))
        return costs

    @property
    def _loops(self) -> Candidates:
        return self.problem.candidates(self.scenarios)

    @property
    def _goal(self) -> Goal:
        return Goal(self.objective.name, self.required, self._scale)

    @property
    def _scale(self) -> float:
        """The size of the objective."""
        if self.objective.name == "abscissa":
            return abs(float(self.survey.abscissa.min()))
        return 1.0

    def _map_costs(self, cells: Indices) -> Array:
        """Costs of cells of the map; infinite for those left out, since a cost takes long."""
        abscissa = self.survey.abscissa.ravel()[cells]
        most = _CELLS_SIMULATED if self.objective.simulated else _CELLS_BY_POLES
        # A third of them the most stable ones, the others at equal strides.
        order = np.argsort(abscissa, kind="stable")
        rest = order[most // 3 :]
        taken = np.append(order[: most // 3], rest[:: max(1, -(-rest.size * 3 // (2 * most)))])
        costs = np.full(len(cells), np.inf)
        points = self.survey.points[cells[taken]]
        costs[taken] = self.objective.coarse(self.problem, points, self.scenarios).max(axis=1)
        return costs


def _by_grids(
    least_of: Callable[[Array], tuple[int, float]],
    start: Array,
    reach: Array,
    low: Array,
    high: Array,
    grids: int,
) -> Pair:
    """The best point, and half the width of the next grid."""
    best, least = start, np.inf
    offsets = np.linspace(-1.0, 1.0, _SIDE[len(start)])
    for _ in range(grids):
        points = grid_points(
            [
                np.unique(np.clip(middle + offsets * side, first, last))
                for middle, side, first, last in zip(best, reach, low, high, strict=True)
            ]
        )
        place, cost = least_of(points)
        moved = points[place] - best
        if cost < least:
            best, least = best + moved, cost
        # Along a kink the best point walks: the grid narrows where it has arrived.
        if np.all(np.abs(moved) <= _ARRIVED * reach):
            reach = _NARROWER * reach
    return best, reach
