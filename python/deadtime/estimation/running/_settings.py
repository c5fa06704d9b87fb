"""What the bank of filters is told before the first row."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import interval, non_negative
from deadtime.estimation._native import FlightPlant
from deadtime.estimation.likelihood._disturbances import Disturbance, disturbances_of
from deadtime.estimation.likelihood._plant import plant_model
from deadtime.experiments import FlightNoise
from deadtime.loops import ControlLoop

#: Number of delays and of lags in a range without a number.
DELAYS, LAGS = 50, 5

#: Time constant that stands for air that walks, s.
SLOW = 100.0

#: Deviation of a trim, in the trim that was fitted.
OF_TRIM = 3.0

#: Seconds of an hour.
HOUR = 3600.0

#: False alarms come so many times more seldom than the bound on their rate says, as measured over
#: 100 simulated hours (docs/theory/measured-estimates.md): the walk of the filters covers what
#: chance does, and the sum passes its threshold by more than nothing.
SELDOM = 4.0

#: The second bank has a delay in so many seconds where the first has more.
COARSE = 0.01


class BankSettings(NamedTuple):
    """The settings of the kernel, by its names."""

    num: list[float]
    den: list[float]
    air_behind_lags: bool
    own_lag: float
    delays: list[float]
    follow: bool
    layers: list[tuple[list[float], float, list[float]]]
    gain: tuple[float, float]
    memory: float
    drift: float
    gain_walk: float
    width: float
    alarm: float
    every: int
    at_rest: bool
    level: float
    freedom: float
    white: float = 1.0
    trim: float = 0.0
    disturbances: Sequence[Disturbance] = ()

    def under(self, noise: FlightNoise) -> BankSettings:
        """The settings for this noise."""
        if noise.white <= 0.0:
            raise ValueError(
                f"noise={noise!r} contains no white noise: give a standard deviation above zero"
            )
        return self._replace(
            white=noise.white,
            trim=OF_TRIM * abs(noise.trim),
            disturbances=disturbances_of(noise, SLOW),
        )


def is_range(given: Any) -> bool:
    """Whether these are (low, high) or (low, high, n), not the points themselves."""
    return not isinstance(given, np.ndarray) and len(given) <= 3


def points_of_range(name: str, given: Any, number: int) -> Array:
    """The points of (low, high) or (low, high, n), or those given."""
    if not is_range(given):
        return np.asarray(given, dtype=float)
    if len(given) == 3:
        number = int(given[2])
    low, high = interval(name, tuple(given[:2]))
    if low < 0.0:
        raise ValueError(f"{name}={given!r}: give times of zero or more")
    if number < 3:
        raise ValueError(f"{name}={given!r}: give three or more points")
    return np.linspace(low, high, number)


def linear_plant(loop: ControlLoop, names: tuple[str, ...]) -> FlightPlant:
    """The plant as the kernel takes it."""
    if not loop.plant.is_linear:
        raise ValueError(
            f"the plant {loop.plant!r} is not linear, but the filters need a linear plant: give "
            "the plant without its limits, and give commands that already follow the limits"
        )
    return plant_model(loop.plant, names)


def lag_sets(model: FlightPlant, lags: Array | None) -> list[list[float]]:
    """The lags of each layer: those of the plant, the first of them replaced by each of `lags`."""
    if lags is None:
        return [list(model.lags)]
    if not model.lags:
        raise ValueError(
            "lags= needs a plant with a lag: give Integrator(lag=…), FirstOrder or FactoredPlant"
        )
    return [[float(lag), *model.lags[1:]] for lag in lags]


def alarm_of(false_alarms_per_hour: float) -> float:
    """Mean time between the false alarms that the sum of a change is held against, s."""
    rate = non_negative("false_alarms_per_hour", false_alarms_per_hour)
    return HOUR / (SELDOM * rate) if rate else math.inf


def coarser(delays: Array) -> int:
    """Every how many of these delays the second bank has one."""
    return max(1, round(COARSE / float(np.median(np.diff(delays)))))
