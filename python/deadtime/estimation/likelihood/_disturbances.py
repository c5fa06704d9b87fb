"""Air and coloured noise of the sensor, as the kernel takes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation._native import whitened_columns
from deadtime.experiments import FlightNoise
from deadtime.loops import Plant


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
