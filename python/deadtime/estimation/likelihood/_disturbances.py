"""Air and coloured noise of the sensor, as the kernel takes them."""

from __future__ import annotations

import math
from typing import NamedTuple

from deadtime.experiments import FlightNoise


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
    return [one for one in every if one.deviation > 0.0]
