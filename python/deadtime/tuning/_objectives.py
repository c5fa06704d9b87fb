"""What a design makes best, as a cost: the smaller the better, the worst scenario counts.

abscissa       Re of the rightmost pole.
damping        the smallest damping ratio -Re s/abs(s) of the dominant poles, those that decay at
               most three times as fast as the slowest (a delay always leaves fast poles with little
               damping, which do not show). It is 1 over whole ranges of gains, so the abscissa
               decides where it is equal.
settling_time  of the step of the reference, with hold and limit, simulated exactly; the longest
               for the gains themselves and for gains half a percent beside them. The settling
               time jumps where a peak leaves the band, and the shortest one lies next to such a
               jump: gains that are rounded to three digits would fall over it.
overshoot      of the same steps; up to a tenth of a percent counts as none, and the settling time
               decides where it is equal.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops import commands_at_rest, sweep
from deadtime.tuning._candidates import Scenario
from deadtime.tuning._problem import ObjectiveName, Problem
from deadtime.tuning._settling import BAND, proved_steps

#: Cost of a loop that does not settle: above every other cost.
NEVER = 1e6

#: Relative distance of the neighbouring gains that are judged with the gains themselves: the
#: largest change by rounding to three digits.
_ROUNDING = 0.005

#: Settling band of the search: a little narrower than the 2 % that are reported, as a margin for
#: what lies between the gains and delays that are tried.
SEARCH_BAND = 0.0195

#: Overshoot in % that counts as none, and the cost of each further percent in seconds of settling
#: time.
NO_OVERSHOOT = 0.1
_OVERSHOOT_WEIGHT = 10.0


class Objective(ABC):
    """A cost of a loop, and the value that is reported for it."""

    name: ObjectiveName
    #: Whether loops are simulated; many at once then cost little more than one.
    simulated = False
    #: Relative difference of costs that counts as none.
    tolerance = 1e-6

    def costs(self, problem: Problem, points: Array, scenarios: Sequence[Scenario]) -> Array:
        """Cost of every row of gains in every scenario."""
        return problem.candidates(scenarios).costs(points, self.name, problem.threads)

    @abstractmethod
    def value(self, problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> float:
        """The figure itself, at its worst over the scenarios."""

    def coarse(self, problem: Problem, points: Array, scenarios: Sequence[Scenario]) -> Array:
        """Costs of the gains without their neighbours, which take less time."""
        return self.costs(problem, points, scenarios)

    def proved(self, problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> float:
        """The figure, where it is simulated with a proof of what follows the simulated time."""
        return self.value(problem, gains, scenarios)

    def worst(self, problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> float:
        """Cost of one set of gains in its worst scenario."""
        return float(self.costs(problem, gains[None, :], scenarios).max())

    def lost(self, value: float, reference: float) -> float:
        """How much worse a figure is than a reference, as a part of that."""
        return (value - reference) / max(abs(reference), 1e-300)


class _Abscissa(Objective):
    name: ObjectiveName = "abscissa"

    def value(self, problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> float:
        return self.worst(problem, gains, scenarios)


class _Damping(Objective):
    name: ObjectiveName = "damping"
    tolerance = 1e-4

    def value(self, problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> float:
        return float(problem.candidates(scenarios).dominant(gains.tolist())[:, 0].min())

    def lost(self, value: float, reference: float) -> float:
        return super().lost(-value, -reference)


class _SettlingTime(Objective):
    name: ObjectiveName = "settling_time"
    simulated = True
    tolerance = 1e-3

    def costs(self, problem: Problem, points: Array, scenarios: Sequence[Scenario]) -> Array:
        around = _rounded(points)
        costs = self.coarse(problem, around.reshape(-1, points.shape[-1]), scenarios)
        return np.asarray(costs.reshape(*around.shape[:2], -1).max(axis=1))

    def coarse(self, problem: Problem, points: Array, scenarios: Sequence[Scenario]) -> Array:
        settling, overshoot = _figures(problem, points, scenarios, SEARCH_BAND)
        lost = ~np.isfinite(settling)
        return np.where(lost, NEVER, self._cost(np.where(lost, 0.0, settling), overshoot))

    def value(self, problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> float:
        settling, overshoot = _figures(problem, _rounded(gains[None, :])[0], scenarios, BAND)
        return self._figure(settling, overshoot)

    def proved(self, problem: Problem, gains: Array, scenarios: Sequence[Scenario]) -> float:
        worst = self.value(problem, gains, scenarios)
        steps = proved_steps(problem.at(gains), scenarios, problem.amplitude)
        for one, step in zip(scenarios, steps, strict=True):
            if step is None:
                told = ", ".join(f"{name} = {number:.6g}" for name, number in one.items())
                raise ValueError(
                    f"a step of {problem.amplitude:g} settles in simulation with "
                    f"{problem.named(gains)}, but for {told} it is not proved to stay in the "
                    "band: ask for margins, or for another objective"
                )
            worst = max(worst, self._figure(*np.array(step)))
        return worst

    def _cost(self, settling: Array, overshoot: Array) -> Array:
        return settling

    def _figure(self, settling: Array, overshoot: Array) -> float:
        return float(settling.max())


class _Overshoot(_SettlingTime):
    name: ObjectiveName = "overshoot"

    def _cost(self, settling: Array, overshoot: Array) -> Array:
        return settling + _OVERSHOOT_WEIGHT * np.maximum(overshoot - NO_OVERSHOOT, 0.0)

    def _figure(self, settling: Array, overshoot: Array) -> float:
        return float(overshoot.max())


_OBJECTIVES = {one.name: one for one in (_Abscissa(), _Damping(), _SettlingTime(), _Overshoot())}


def objective_named(name: str) -> Objective:
    """The objective of that name."""
    if name not in _OBJECTIVES:
        raise ValueError(f"objective={name!r}: give one of {', '.join(map(repr, _OBJECTIVES))}")
    return _OBJECTIVES[name]


def _rounded(points: Array) -> Array:
    """Each row of gains and its neighbours, shape (rows, 1 + neighbours, gains)."""
    signs = np.array([*itertools.product((-1.0, 1.0), repeat=points.shape[-1])])
    factors = 1.0 + _ROUNDING * np.vstack([np.zeros(points.shape[-1]), signs])
    return np.asarray(points[:, None, :] * factors)


def _figures(
    problem: Problem, points: Array, scenarios: Sequence[Scenario], band: float
) -> tuple[Array, Array]:
    """Settling time in s, NaN where a loop does not settle, and overshoot in %."""
    values = {name: points[:, [i]] for i, name in enumerate(problem.free)}
    for name in problem.intervals:
        values[name] = np.array([[one[name] for one in scenarios]])
    found = sweep(
        problem.loop,
        values,
        amplitude=problem.amplitude,
        settling=band,
        threads=problem.threads,
    )
    # An output that the limit keeps away from its rest has not settled, even if it is constant.
    low, high = problem.loop.specification.bounds
    command = commands_at_rest(problem.loop, values, problem.amplitude)
    short = (command > high) | (command < low)
    return np.where(short, np.nan, found["settling_time"]), found["overshoot"]
