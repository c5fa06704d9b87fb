"""Output of a plant under held commands, for a gain of one and no delay, with its derivatives.

A path is F(t; lag or time constant) for a gain of one and no delay. An integrator has a closed
form (`held_response`); any other plant is simulated, and its derivatives are central difference
quotients with an error of about 1e-9 of the path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from deadtime.estimation.models._held_response import HeldResponse
from deadtime.loops import Integrator, Plant
from deadtime.loops._open_run import open_response

__all__ = ["Path", "PathSlopes", "path_of"]

Array = NDArray[np.float64]

#: Relative step of difference quotients: of a parameter, or of the time between two commands.
STEP = 1e-5


class PathSlopes(NamedTuple):
    """dF/dt, and the derivatives of F by the parameters of the plant."""

    rate: Array
    by: dict[str, Array]


class Path(Protocol):
    """Output of a plant of unit gain under one record of commands."""

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        """F at `times`, of any shape, for these parameters of the plant."""

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        """Derivatives of F at `times`, by those of `names` that the plant has."""


def path_of(plant: Plant, time: Array, command: Array) -> Path:
    """The path of `plant` under `command`, each value held from its time on."""
    if isinstance(plant, Integrator):
        return _IntegratorPath(HeldResponse(time, command))
    return _SteppedPath(plant, time, command)


class _IntegratorPath:
    def __init__(self, response: HeldResponse) -> None:
        self._response = response

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        return self._response.at(times, values["lag"]).value

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        found = self._response.at(times, values["lag"])
        return PathSlopes(found.rate, {"lag": found.by_lag} if "lag" in names else {})


class _SteppedPath:
    def __init__(self, plant: Plant, time: Array, command: Array) -> None:
        self._plant, self._time, self._command = plant, time, command
        self._change = STEP * float(np.median(np.diff(time)))

    def value(self, times: Array, values: Mapping[str, float]) -> Array:
        distinct, place = np.unique(times, return_inverse=True)
        numbers = {**self._plant.parameters, **values, "gain": 1.0}
        path = open_response(self._plant, numbers, distinct, self._time, self._command)
        return path[place].reshape(times.shape)

    def slopes(self, times: Array, values: Mapping[str, float], names: Sequence[str]) -> PathSlopes:
        change = self._change
        rate = (self.value(times + change, values) - self.value(times - change, values)) / (
            2.0 * change
        )
        by = {}
        for name in names:
            if name in self._plant.parameters and name != "gain":
                step = STEP * abs(values[name])
                higher, lower = (
                    self.value(times, {**values, name: values[name] + sign * step})
                    for sign in (1.0, -1.0)
                )
                by[name] = (higher - lower) / (2.0 * step)
        return PathSlopes(rate, by)
