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
from deadtime.tuning._margins import MarginEstimate, RequiredMargins
from deadtime.tuning._objectives import NEVER, Objective
from deadtime.tuning._problem import Problem, Scenario
from deadtime.tuning._survey import Survey, grid_points, worst_abscissa

#: Cost of a relative shortfall of 1 of a margin, in units of the objective: large enough that no
#: gain in the objective pays for a shortfall.
_PENALTY = 50.0

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

#: Most simplices in sequence, ratio of their sizes, and evaluations of each.
_SIMPLICES = 6
_SMALLER = 0.35
_EVALUATIONS = 150
#: Relative accuracy of the gains, as a fraction of their ranges, and relative improvement that
#: counts as none. Where roots meet, the abscissa has cusps, so that gains known to 1e-7 leave it
#: known to 1e-3.
_GAINS_KNOWN = 3e-7
_IDLE = 1e-4

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
_ARRIVED = 0.5

#: Relative half width of the first grid around the best gains alone in which the best ones with
#: their neighbours are sought.
_NEAR = 0.03

#: Frequency stride of the coarse margin estimate.
_COARSE = 3

#: Shortfall of the margins that counts as none.
_MET = 1e-6

#: Shortfall assigned to an unstable loop: that of all three margins together.
_UNSTABLE = 3.0

#: Costs of rows of gains in scenarios.
Judge: TypeAlias = Callable[[Problem, Array, Sequence[Scenario]], Array]

Pair: TypeAlias = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Search:
    """A search for the gains that are best in some scenarios, with the required margins there."""

    problem: Problem
    objective: Objective
    survey: Survey
    estimate: MarginEstimate
    required: RequiredMargins
    scenarios: Sequence[Scenario] = ()

    def globally(self) -> Array:
        """The best gains, from the map."""
        points, stable = self.survey.points, np.flatnonzero(self.survey.stable)
        costs = np.full(len(points), np.inf)
        short = np.zeros(len(stable))
        if self.required.named:
            short = self._shortfalls(points[stable], _COARSE)
        met = stable[short <= _MET]
        if met.size:
            costs[met] = self._map_costs(met)
            if self.objective.simulated:
                return self._firmest(points, costs)
            starts = self.survey.chosen(points, costs, _STARTS)
        else:
            # Perhaps the requirements are met between the cells.
            costs[stable] = short
            starts = self.survey.chosen(points, costs, 1)
        found = [self._by_grids(start) for start in starts]
        return self._polished(*min(found, key=lambda one: self._total(one[0])))

    def _firmest(self, points: Array, costs: Array) -> Array:
        """The best gains with their neighbours, from more starts where those lose much by them."""
        for axes in self.survey.fringes:
            points = np.vstack([points, grid_points(axes)])
            found = self._totals(axes, self.objective.coarse)
            costs = np.append(costs, found)
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
            costs = partial(self._totals, judge=judge)
            return _by_grids(costs, around, reach, low, high, grids)

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
        low, high = np.array(self.survey.bounds).T
        if self.objective.simulated:
            return start
        if len(start) == 1:
            return _between_neighbours(self._total, start, reach, low, high)
        return _by_simplices(self._total, start, 0.5 * reach, low, high)

    def short(self, gains: Array) -> float:
        """By how much gains fall short of the required margins, by the estimate."""
        return self._short(gains, self.objective.worst(self.problem, gains, self.scenarios))

    def _short(self, gains: Array, cost: float) -> float:
        """The same for gains of this cost; an unstable loop has crossings, which are no margins."""
        stable = cost < (0.0 if self.objective.name == "abscissa" else NEVER)
        return float(self._shortfalls(gains[None, :])[0]) if stable else _UNSTABLE

    def _shortfalls(self, points: Array, stride: int = 1) -> Array:
        """The same of every row of gains."""
        return self.required.shortfall(self.estimate.of(points, self.scenarios, stride))

    def _total(self, gains: Array) -> float:
        """Cost of gains, shortfalls of margins included."""
        cost = self.objective.worst(self.problem, gains, self.scenarios)
        if not self.required.named:
            return cost
        return cost + _PENALTY * self._scale * self._short(gains, cost)

    def _totals(self, axes: list[Array], judge: Judge) -> Array:
        """The same of every point of a grid."""
        points = grid_points(axes)
        late = worst_abscissa(self.problem, axes, self.scenarios).ravel()
        stable = np.isfinite(late)
        short = np.where(stable, 0.0, _UNSTABLE)
        if self.required.named and stable.any():
            short[stable] = self._shortfalls(points[stable], _COARSE)
        if self.objective.name == "abscissa":
            costs = np.where(stable, late, 0.0)
            return np.asarray(costs + _PENALTY * self._scale * short)
        # Only what may be taken is simulated.
        costs = NEVER * (1.0 + short)
        good = short <= _MET
        if good.any():
            found = judge(self.problem, points[good], self.scenarios)
            costs[good] = found.max(axis=1)
        return costs

    @property
    def _scale(self) -> float:
        """The size of the objective."""
        if self.objective.name == "abscissa":
            return abs(float(self.survey.abscissa.min()))
        return 1.0

    def _map_costs(self, cells: Indices) -> Array:
        """Costs of cells of the map; infinite for those left out where a cost takes long."""
        abscissa = self.survey.abscissa.ravel()[cells]
        if self.objective.name == "abscissa":
            return np.asarray(abscissa)
        most = _CELLS_SIMULATED if self.objective.simulated else _CELLS_BY_POLES
        # A third of them the most stable ones, the others at equal strides.
        order = np.argsort(abscissa, kind="stable")
        rest = order[most // 3 :]
        taken = np.append(order[: most // 3], rest[:: max(1, -(-rest.size * 3 // (2 * most)))])
        costs = np.full(len(cells), np.inf)
        points = self.survey.points[cells[taken]]
        costs[taken] = self.objective.coarse(self.problem, points, self.scenarios).max(axis=1)
        return costs


def _between_neighbours(
    cost: Callable[[Array], float], start: Array, reach: Array, low: Array, high: Array
) -> Array:
    from scipy.optimize import minimize_scalar

    ends = (float(max(start[0] - reach[0], low[0])), float(min(start[0] + reach[0], high[0])))
    found = minimize_scalar(
        lambda gain: cost(np.array([gain])),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-9 * (high[0] - low[0]), "maxiter": 200},
    )
    return np.array([found.x]) if found.fun <= cost(start) else start


def _by_grids(
    costs: Callable[[list[Array]], Array],
    start: Array,
    reach: Array,
    low: Array,
    high: Array,
    grids: int,
) -> tuple[Array, Array]:
    """The best point, and half the width of the next grid."""
    best, least = start, np.inf
    offsets = np.linspace(-1.0, 1.0, _SIDE[len(start)])
    for _ in range(grids):
        axes = [
            np.unique(np.clip(middle + offsets * side, first, last))
            for middle, side, first, last in zip(best, reach, low, high, strict=True)
        ]
        found = costs(axes)
        place = int(np.argmin(found))
        moved = grid_points(axes)[place] - best
        if found[place] < least:
            best, least = best + moved, float(found[place])
        # Along a kink the best point walks: the grid narrows where it has arrived.
        if np.all(np.abs(moved) <= _ARRIVED * reach):
            reach = _NARROWER * reach
    return best, reach


def _by_simplices(
    cost: Callable[[Array], float], start: Array, size: Array, low: Array, high: Array
) -> Array:
    from scipy.optimize import minimize

    best, least, turn, idle = start, cost(start), 1.0, 0
    for _ in range(_SIMPLICES):
        corners = best + np.vstack([np.zeros(len(best)), turn * np.diag(size)])
        found = minimize(
            cost,
            best,
            method="Nelder-Mead",
            bounds=list(zip(low, high, strict=True)),
            options={
                "initial_simplex": np.clip(corners, low, high),
                "xatol": _GAINS_KNOWN * float((high - low).min()),
                "fatol": np.inf,
                "maxfev": _EVALUATIONS,
            },
        )
        gained = least - float(found.fun)
        if gained > 0.0:
            best, least = np.asarray(found.x, dtype=np.float64), float(found.fun)
        idle = idle + 1 if gained < _IDLE * abs(least) else 0
        if idle == 2:
            break
        size, turn = _SMALLER * size, -turn
    return best
