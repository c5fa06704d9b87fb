"""Least squares over delay, gain and lag on the misfit at lines of a spectrum, and its profile.

The cost has several local minima over the delay, so a grid over the delay comes first. A lag may be
at zero, its bound, where it acts like a delay to first order: a lag that does not reduce the cost
is set to zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError

Values: TypeAlias = dict[str, float]

#: Points of the initial grid over the delay for each sample, and most points.
POINTS_PER_SAMPLE, MOST_POINTS = 1, 400

#: A lag is set to zero where this raises the cost by less than this share.
VANISHING = 1e-6


class Lines(NamedTuple):
    """The fitted lines: their misfit, over its standard deviation where that is known."""

    misfit: Callable[[Values], Array]
    known_noise: bool
    freedom: int
    widening: float
    longest: float
    sample_time: float
    describe: str

    def cost(self, values: Values) -> float:
        misfit = self.misfit(values)
        return float(misfit @ misfit)


def fit_lines(lines: Lines, names: tuple[str, ...], known: Values) -> tuple[Values, Array]:
    """The parameters of least cost, and the derivatives of the misfit by `names` there.

    The derivative by a lag at its bound is zero.
    """
    start = dict(known)
    if "lag" in names:
        start["lag"] = lines.sample_time
    if "delay" in names:
        start["delay"] = _best_delay(lines, names, start)
    values, jacobian = _descend(lines, names, start)
    if "lag" not in names:
        return values, jacobian
    others = tuple(name for name in names if name != "lag")
    without = values | {"lag": 0.0}
    if "delay" in names:
        without["delay"] += values["lag"]
    columns = np.zeros_like(jacobian)
    if others:
        without, own = _descend(lines, others, without)
        columns[:, [i for i, name in enumerate(names) if name != "lag"]] = own
    if lines.cost(without) > lines.cost(values) * (1.0 + VANISHING):
        return values, jacobian
    return without, columns


def _descend(lines: Lines, names: tuple[str, ...], start: Values) -> tuple[Values, Array]:
    """Least squares over `names` from a starting point."""
    from scipy.optimize import least_squares

    def misfit(point: Array) -> Array:
        return lines.misfit(start | dict(zip(names, (float(x) for x in point), strict=True)))

    found = least_squares(
        misfit,
        [start[name] for name in names],
        bounds=([-np.inf if name == "gain" else 0.0 for name in names], np.inf),
        jac="3-point",
        x_scale=[abs(start["gain"]) if name == "gain" else lines.sample_time for name in names],
        xtol=1e-13,
        ftol=1e-13,
        gtol=None,  # an absolute bound, in units of the output squared
        max_nfev=100,
    )
    point = {name: float(value) for name, value in zip(names, found.x, strict=True)}
    return start | point, np.asarray(found.jac)


def _best_delay(lines: Lines, names: tuple[str, ...], start: Values) -> float:
    """The best delay of a grid, with the best gain for each."""
    count = int(min(MOST_POINTS, max(2.0, POINTS_PER_SAMPLE * lines.longest / lines.sample_time)))
    grid = np.linspace(0.0, lines.longest, count + 1)
    costs = [_at_best_gain(lines, start | {"delay": float(delay)}, names) for delay in grid]
    place = int(np.argmin(costs))
    if place == count:
        raise NotIdentifiableError(
            f"the fit ends at a delay of {grid[-1]:.3g} s, the longest of the search: the output "
            "is no response to this command; check columns and units"
        )
    return float(grid[place])


def _at_best_gain(lines: Lines, values: Values, names: tuple[str, ...]) -> float:
    """Least cost over the gain where it is free; the misfit is linear in the gain."""
    now = lines.misfit(values)
    if "gain" in names:
        slope = now - lines.misfit(values | {"gain": 0.9 * values["gain"]})
        power = float(slope @ slope)
        now = now - slope * float(slope @ now) / power if power > 0.0 else now
    return float(now @ now)


@dataclass(frozen=True)
class LineProfile:
    """Least cost with one quantity held, searched from the best values."""

    lines: Lines
    names: tuple[str, ...]
    best: Values

    def __call__(self, name: str, value: float) -> float:
        if name != "delay+lag":
            return self._least(self.lines, name, value)
        if "lag" not in self.names:
            return self._least(self.lines, "delay", max(0.0, value - self.best["lag"]))

        # With the sum held, the delay is the sum less the lag, and no less than zero.
        def misfit(values: Values) -> Array:
            return self.lines.misfit(values | {"delay": max(0.0, value - values["lag"])})

        return self._least(self.lines._replace(misfit=misfit), "delay", value)

    def _least(self, lines: Lines, name: str, value: float) -> float:
        others = tuple(other for other in self.names if other != name)
        held = self.best | {name: value}
        if name == "delay" and "lag" in others:
            # To first order the lag replaces the change of the delay.
            held["lag"] = max(0.0, self.best["delay"] + self.best["lag"] - value)
        return lines.cost(_descend(lines, others, held)[0] if others else held)
