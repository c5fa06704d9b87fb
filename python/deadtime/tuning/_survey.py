"""The map from which a search begins: gains that are stable in every scenario, with abscissa."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime.stability import StabilityMap, stability_map
from deadtime.tuning._candidates import Scenario
from deadtime.tuning._problem import Problem

#: Points of the map along each free gain, for one, two and three of them: more points find narrower
#: stable regions and cost time in proportion to their product.
_SHAPES = {1: (401,), 2: (61, 61), 3: (21, 21, 9)}

#: A map over one gain has the delay as its second axis: number of delays, and how far these reach
#: beyond the interval, as a part of its ends.
_CHART_DELAYS = 41
_BEYOND = 0.5

#: How far a map without a survey reaches, as a multiple of the gains.
_SHOWN = 3.0

#: Maps by the numbers that are the same in all their cells.
Maps = dict[frozenset[tuple[str, float]], StabilityMap]


@dataclass(frozen=True, eq=False)
class Survey:
    """Gains on a grid, and their worst abscissa over the corners of what is not known.

    Attributes
    ----------
    axes : tuple of ndarray
        Values of each free gain.
    abscissa : ndarray, shape of the grid
        Worst spectral abscissa, 1/s; inf where a scenario is not stable.
    maps : dict
        Maps over two gains, by the other numbers.
    """

    axes: tuple[Array, ...]
    abscissa: Array
    maps: Maps = field(default_factory=dict, repr=False)

    @property
    def is_empty(self) -> bool:
        """Whether no gains but those of zero are stable in every scenario."""
        stable = np.isfinite(self.abscissa)
        zero = np.ix_(*(axis == 0.0 for axis in self.axes))
        stable[zero] = False
        return not stable.any()


def surveyed(problem: Problem, shape: Sequence[int] | None) -> Survey:
    """Map the free gains of a problem in each of its corners."""
    free = problem.free
    counts = _SHAPES[len(free)] if shape is None else tuple(shape)
    if len(counts) != len(free) or min(counts) < 2:
        raise ValueError(
            f"shape={counts}: give {len(free)} numbers of points, 2 or more, for {', '.join(free)}"
        )
    for spans in problem.spans:
        axes = tuple(
            np.linspace(*spans[name], count) for name, count in zip(free, counts, strict=True)
        )
        maps: Maps = {}
        worst = worst_abscissa(problem, axes, problem.corners, maps)
        survey = Survey(axes, worst, maps)
        if not survey.is_empty:
            return survey
    tried = ", nor in ".join(
        " and ".join(f"{name} from {low:.4g} to {high:.4g}" for name, (low, high) in spans.items())
        for spans in problem.spans
    )
    late = " or ".join(f"{delay:g}" for delay in problem.delays)
    raise ValueError(
        f"{'x'.join(map(str, counts))} gains were tried in {tried}, and none is stable with a "
        f"delay of {late} s. Other gains may be stable: give other ranges="
    )


def worst_abscissa(
    problem: Problem,
    axes: Sequence[Array],
    scenarios: Sequence[Scenario],
    maps: Maps | None = None,
) -> Array:
    """Worst spectral abscissa on a grid of the free gains, infinite where one is not stable.

    `maps` receives the maps over two gains, where there are no others. Maps are much cheaper than
    loops one by one: they follow the roots from cell to cell.
    """
    free = problem.free
    worst = np.full([len(axis) for axis in axes], -np.inf)
    if len(free) == 1:
        # The delays of all scenarios are columns of one map.
        for rest, delays in _by_the_rest(scenarios).items():
            chart = _mapped(problem, dict(rest), {free[0]: axes[0], "delay": np.unique(delays)})
            worst = np.maximum(worst, _judged(chart).max(axis=1))
        return worst
    plane = dict(zip(free[:2], axes[:2], strict=True))
    for layer in itertools.product(*(range(len(axis)) for axis in axes[2:])):
        held = {
            name: float(axis[i]) for name, axis, i in zip(free[2:], axes[2:], layer, strict=True)
        }
        place: Any = (..., *layer)
        for scenario in scenarios:
            chart = _mapped(problem, scenario | held, plane)
            if maps is not None and not held:
                maps[frozenset(scenario.items())] = chart
            worst[place] = np.maximum(worst[place], _judged(chart))
    return worst


def charts_at(
    problem: Problem, survey: Survey | None, gains: Sequence[float]
) -> tuple[StabilityMap, ...]:
    """Maps to look at: over two gains, one for each delay; over one gain and the delay, one.

    A third gain has the value that was found, the gain of the plant its middle.
    """
    free, middle = problem.free, problem.middle
    lines = _around(problem, gains) if survey is None else survey.axes
    maps = {} if survey is None else survey.maps
    if len(free) == 1:
        low, high = problem.intervals["delay"]
        top = (1.0 + _BEYOND) * high or problem.loop.sample_time or 1.0  # a chart has a height
        wide = np.linspace((1.0 - _BEYOND) * low, top, _CHART_DELAYS)
        delays = np.unique(np.append(wide, problem.delays))
        return (_mapped(problem, middle, {free[0]: lines[0], "delay": delays}),)
    held = problem.named(gains)
    axes = {name: lines[i] for i, name in enumerate(free[:2])}
    held = {name: held[name] for name in free[2:]}
    charts = []
    for late in problem.delays:
        numbers = middle | {"delay": late} | held
        known = maps.get(frozenset(numbers.items()))
        charts.append(_mapped(problem, numbers, axes) if known is None else known)
    return tuple(charts)


def _around(problem: Problem, gains: Sequence[float]) -> tuple[Array, ...]:
    """Axes that hold the gains, where there is no survey."""
    counts = _SHAPES[len(gains)]
    if problem.given is not None:
        ends = [problem.given[name] for name in problem.free]
    else:
        # A gain next to zero is shown on the scale of the others.
        least = 0.1 * max(map(abs, gains))
        ends = [
            (-0.5 * least, 3.0 * least) if abs(gain) < least else (0.0, _SHOWN * gain)
            for gain in gains
        ]
    return tuple(
        np.linspace(min(pair), max(pair), count) for pair, count in zip(ends, counts, strict=True)
    )


def _by_the_rest(
    scenarios: Sequence[Scenario],
) -> dict[tuple[tuple[str, float], ...], list[float]]:
    """Delays of the scenarios that agree in everything else."""
    found: dict[tuple[tuple[str, float], ...], list[float]] = {}
    for scenario in scenarios:
        rest = tuple((name, value) for name, value in scenario.items() if name != "delay")
        found.setdefault(rest, []).append(scenario["delay"])
    return found


def _mapped(problem: Problem, numbers: dict[str, float], axes: dict[str, Array]) -> StabilityMap:
    held = {name: value for name, value in numbers.items() if name not in axes}
    loop = problem.loop.replace(**held) if held else problem.loop
    return stability_map(loop, axes, threads=problem.threads)


def _judged(chart: StabilityMap) -> Array:
    """Abscissa where a cell is stable, else infinite."""
    return np.where(chart.stable, chart.abscissa, np.inf)
