"""What the bank of filters is told before the first row."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import interval, non_negative, positive
from deadtime.estimation.likelihood._search import PlantModel
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


class GivenDisturbance(NamedTuple):
    """Air or coloured noise, in deviations of the white noise."""

    at_input: bool
    time_constant: float
    deviation: float


class BankSettings(NamedTuple):
    """The settings of the kernel, by its names."""

    num: tuple[float, ...]
    den: tuple[float, ...]
    air_behind_lags: bool
    own_lag: float
    delays: list[float]
    layers: list[tuple[list[float], float, list[float]]]
    disturbances: list[GivenDisturbance]
    gain: tuple[float, float]
    trim: float
    white: float
    freedom: float
    memory: float
    drift: float
    gain_walk: float
    width: float
    alarm: float
    every: int
    at_rest: bool
    level: float


def points_of_range(name: str, given: Any, number: int) -> Array:
    """The points of (low, high) or (low, high, n), or those given."""
    if isinstance(given, np.ndarray) or len(given) > 3:
        return np.asarray(given, dtype=float)
    if len(given) == 3:
        number = int(given[2])
    low, high = interval(name, tuple(given[:2]))
    if low < 0.0:
        raise ValueError(f"{name}={given!r}: give times of at least zero")
    if number < 3:
        raise ValueError(f"{name}={given!r}: give three points or more")
    return np.linspace(low, high, number)


def plant_model(loop: ControlLoop, names: tuple[str, ...]) -> PlantModel:
    """The plant as the kernel takes it."""
    if not loop.plant.is_linear:
        raise ValueError(
            f"the plant {loop.plant!r} is not linear: the filters are for linear plants; give the "
            "plant behind its limits and the command after them"
        )
    return PlantModel.of(loop.plant, names)


def lag_sets(model: PlantModel, lags: Array | None) -> list[list[float]]:
    """The lags of each layer: those of the plant, the first of them replaced by each of `lags`."""
    if lags is None:
        return [list(model.lags)]
    if not model.lags:
        raise ValueError(
            "lags= is for a plant with a lag: give Integrator(lag=…), FirstOrder or FactoredPlant"
        )
    return [[float(lag), *model.lags[1:]] for lag in lags]


def settings_of(
    model: PlantModel,
    noise: FlightNoise,
    *,
    delays: Array,
    lags: Sequence[Sequence[float]],
    prior: Array,
    gain: tuple[float, float],
    drift: float,
    gain_walk: float,
    false_alarms_per_hour: float,
    freedom: float,
    memory: float,
    width: float,
    at_rest: bool,
    level: float,
) -> BankSettings:
    """Check and join everything. `prior`, shape (lags, delays), holds logarithms."""
    if noise.white <= 0.0:
        raise ValueError(f"noise={noise!r} has no white noise: give its deviation, above zero")
    disturbances = [
        GivenDisturbance(True, noise.air_time, noise.air / noise.white),
        GivenDisturbance(True, SLOW, noise.air_walk * math.sqrt(SLOW / 2.0) / noise.white),
        GivenDisturbance(False, noise.sensor_time, noise.sensor / noise.white),
    ]
    rate = non_negative("false_alarms_per_hour", false_alarms_per_hour)
    spacing = float(np.median(np.diff(delays)))
    return BankSettings(
        num=model.num,
        den=model.den,
        air_behind_lags=model.air_behind_lags,
        own_lag=model.own_lag,
        delays=delays.tolist(),
        layers=[
            (list(one), model.zero, weights)
            for one, weights in zip(lags, prior.tolist(), strict=True)
        ],
        disturbances=[one for one in disturbances if one.deviation > 0.0],
        gain=gain,
        trim=OF_TRIM * abs(noise.trim),
        white=noise.white,
        freedom=freedom,
        memory=positive("memory", memory),
        drift=non_negative("drift", drift),
        gain_walk=non_negative("gain_drift", gain_walk),
        width=positive("width", width),
        alarm=HOUR / (SELDOM * rate) if rate else math.inf,
        every=max(1, round(COARSE / spacing)),
        at_rest=at_rest,
        level=level,
    )
