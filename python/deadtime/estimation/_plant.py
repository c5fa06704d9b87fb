"""A plant as the kernel fits it, num/den of unit gain behind lags, and what disturbs it.

Disturbances are air and coloured noise of the sensor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

import deadtime.loops as loops
from deadtime._base.arrays import Array
from deadtime.estimation._native import FlightPlant, whitened_columns
from deadtime.experiments import FlightNoise
from deadtime.loops import Plant


def behind_limits(plant: Plant) -> Plant:
    """The plant after its limits of the rate of its command, if it has some."""
    return plant.plant if isinstance(plant, loops.RateLimited) else plant


def names_in_kernel(plant: Plant) -> tuple[str, ...]:
    """The numbers of a loop with this plant that the kernel fits."""
    plant = behind_limits(plant)
    if not isinstance(plant, (loops.Integrator, loops.FirstOrder, loops.FactoredPlant)):
        return ("delay", "gain")
    return ("delay", *(name for name in plant.parameters if name not in loops.PAIR))


def plant_model(plant: Plant, names: tuple[str, ...], air_behind_lags: bool = False) -> FlightPlant:
    """The plant with `names` free; one that limits rates, after its limits.

    Air acts behind its lags or through them.
    """
    plant = behind_limits(plant)
    zero = own_lag = 0.0
    lags: dict[str, float] = {}
    num: Any = [1.0]
    if isinstance(plant, loops.Integrator):
        den, lags = [1.0, 0.0], {"lag": plant.lag} if "lag" in names or plant.lag else {}
    elif isinstance(plant, loops.FirstOrder):
        den, lags = [1.0], {"time_constant": plant.time_constant}
    else:
        num, den = plant._polynomials({**plant.parameters, "gain": 1.0})
        if isinstance(plant, (loops.FactoredPlant, loops.ParametricPlant)):
            own_lag = plant.lag
        if isinstance(plant, loops.FactoredPlant):
            every = plant.parameters.items()
            found = {name: lag for name, lag in every if name.startswith("lag")}
            found = {name: lag for name, lag in found.items() if lag or name in names}
            if found or plant.has_pair:
                num, den = plant._without_lags({**plant.parameters, "gain": 1.0})
                own_lag += plant.zero - sum(plant.lags)
                lags, zero = found, plant.zero
    return FlightPlant(
        list(num), list(den), list(lags), list(lags.values()), names, zero, own_lag, air_behind_lags
    )


class Disturbance(NamedTuple):
    """An Ornstein-Uhlenbeck process, in standard deviations of the white noise."""

    at_input: bool
    time_constant: float
    deviation: float


def disturbances_of(noise: FlightNoise, slow: float) -> list[Disturbance]:
    """Those of a noise; air that walks is gusts that last for the time `slow`, s."""
    walk = noise.air_walk * math.sqrt(slow / 2.0)
    every = [
        Disturbance(True, noise.air_time, noise.air / noise.white),
        Disturbance(True, slow, walk / noise.white),
        Disturbance(False, noise.sensor_time, noise.sensor / noise.white),
    ]
    return [disturbance for disturbance in every if disturbance.deviation > 0.0]


def whitened(
    plant: Plant, time: Array, columns: Array, disturbances: Sequence[Disturbance]
) -> Array:
    """Columns, a row each, whitened by disturbances of a plant beside white noise."""
    if not disturbances:
        return columns
    num, den = plant._polynomials({**plant.parameters, "gain": 1.0})
    flat = whitened_columns(list(num), list(den), disturbances, time, np.ravel(columns))
    return np.asarray(flat.reshape(columns.shape))
