"""A plant as the kernel fits it: num/den of unit gain behind lags."""

from __future__ import annotations

from typing import Any

from deadtime.estimation._native import FlightPlant
from deadtime.loops import (
    PAIR,
    FactoredPlant,
    FirstOrder,
    Integrator,
    ParametricPlant,
    Plant,
    RateLimited,
)


def behind_limits(plant: Plant) -> Plant:
    """The plant after its limits of the rate of its command, if it has some."""
    return plant.plant if isinstance(plant, RateLimited) else plant


def names_in_kernel(plant: Plant) -> tuple[str, ...]:
    """The numbers of a loop with this plant that the kernel fits."""
    plant = behind_limits(plant)
    own: tuple[str, ...] = ()
    if isinstance(plant, Integrator):
        own = ("lag",)
    elif isinstance(plant, FirstOrder):
        own = ("time_constant",)
    elif isinstance(plant, FactoredPlant):
        own = tuple(name for name in plant.parameters if name not in PAIR)
    return ("delay", "gain", *own)


def plant_model(plant: Plant, names: tuple[str, ...], air_behind_lags: bool = False) -> FlightPlant:
    """The plant with `names` free; one that limits rates, after its limits.

    Air acts behind its lags or through them.
    """
    plant = behind_limits(plant)
    zero = own_lag = 0.0
    lags: dict[str, float] = {}
    num: Any = [1.0]
    if isinstance(plant, Integrator):
        den, lags = [1.0, 0.0], {"lag": plant.lag} if "lag" in names or plant.lag else {}
    elif isinstance(plant, FirstOrder):
        den, lags = [1.0], {"time_constant": plant.time_constant}
    else:
        num, den = plant._polynomials({**plant.parameters, "gain": 1.0})
        if isinstance(plant, (FactoredPlant, ParametricPlant)):
            own_lag = plant.lag
        if isinstance(plant, FactoredPlant):
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
