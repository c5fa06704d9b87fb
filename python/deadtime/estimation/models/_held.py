"""Output of a plant under held commands, with its derivatives.

A path is F(t; lag or time constant) for a gain of one and no delay. That of an integrator is in
closed form in the kernel (`HeldResponse`); any other plant is simulated, and its derivatives are
central difference quotients with an error of about 1e-9 of the path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation._native import integrator_path
from deadtime.loops import Integrator, Plant, RateLimited, open_response

#: Relative step of difference quotients: of a parameter, or of the time between two commands.
STEP = 1e-5

#: Names of the limits of the rate of a command, and the relative step of quotients by them.
RATE_LIMITS, LIMIT_STEP = ("rate", "rate_of_rate"), 1e-4


class Response(NamedTuple):
    """F, dF/dt and dF/dlag at some times."""

    value: Array
    rate: Array
    by_lag: Array


class HeldResponse:
    """The response of an integrator to one record of commands.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Time from which each command holds, s, increasing; the last one holds for ever.
    command : ndarray, shape (n,)
        The commands.
    """

    def __init__(self, time: Array, command: Array) -> None:
        self.time, self.command = time, command

    def at(self, times: Array, lag: float = 0.0) -> Response:
        """F and its derivatives at `times`, of any shape, for a lag in s."""
        found = integrator_path(self.time, self.command, times, lag)
        return Response(*(part.reshape(np.shape(times)) for part in found))

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, as the path of an integrator."""
        return self.at(times, values["lag"]).value

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of that path."""
        found = self.at(times, values["lag"])
        return PathSlopes(found.rate, {"lag": found.by_lag} if "lag" in names else {})


class PathSlopes(NamedTuple):
    """dF/dt, and the derivatives of F by the parameters of the plant."""

    rate: Array
    by: dict[str, Array]


def _quotient(
    path: SteppedPath | LimitedPath,
    times: Array,
    values: Mapping[str, float],
    name: str,
    share: float,
) -> Array:
    """Difference quotient of a path by one number, in steps of a share of it."""
    step = share * abs(values[name])
    higher, lower = (
        path.value(times, {**values, name: values[name] + move}) for move in (step, -step)
    )
    return np.asarray((higher - lower) / (2.0 * step))


class SteppedPath:
    """The simulated output of any other plant."""

    def __init__(self, plant: Plant, time: Array, command: Array) -> None:
        self._plant, self._time, self._command = plant, time, command
        self._change = STEP * float(np.median(np.diff(time)))

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, of any shape, for these parameters of the plant."""
        distinct, place = np.unique(times, return_inverse=True)
        numbers = {**self._plant.parameters, **values, "gain": 1.0}
        path = open_response(self._plant, numbers, distinct, self._time, self._command)
        return path[place].reshape(times.shape)

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of F at `times`, by those of `names` that the plant has."""
        change = self._change
        rate = (self.value(times + change, values) - self.value(times - change, values)) / (
            2.0 * change
        )
        own = [name for name in names if name in self._plant.parameters and name != "gain"]
        by = {name: _quotient(self, times, values, name, STEP) for name in own}
        return PathSlopes(rate, by)


class LimitedPath:
    """The output of a plant that limits the rate of its command."""

    def __init__(self, plant: RateLimited, time: Array, command: Array) -> None:
        self._plant, self._time, self._command = plant, time, command
        self._kept: tuple[dict[str, float], Path] | None = None

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, of any shape, for these parameters of the plant."""
        return self._at(values).value(times, values)

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of F at `times`, by those of `names` that the plant has."""
        found = self._at(values).slopes(times, values, names)
        for name in RATE_LIMITS:
            if name in names:
                found.by[name] = _quotient(self, times, values, name, LIMIT_STEP)
        return found

    def _at(self, values: Mapping[str, float]) -> Path:
        """The path under the command within these limits; kept for the last ones."""
        limits = {name: values[name] for name in RATE_LIMITS if name in values}
        if self._kept is None or self._kept[0] != limits:
            held = self._plant._replace(limits).limited(self._time, self._command)
            self._kept = (limits, path_of(self._plant.plant, *held))
        return self._kept[1]


#: Output of a plant of unit gain under one record of commands.
Path: TypeAlias = HeldResponse | SteppedPath | LimitedPath


def path_of(plant: Plant, time: Array, command: Array) -> Path:
    """The path of `plant` under `command`, each value held from its time on."""
    if isinstance(plant, RateLimited):
        return LimitedPath(plant, time, command)
    if isinstance(plant, Integrator):
        return HeldResponse(time, command)
    return SteppedPath(plant, time, command)
