"""Noise of a run: of the sensor, and of what moves the plant beside the command."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import finite, non_negative
from deadtime.experiments._random_process import RandomProcess
from deadtime.loops import Plant

Seed: TypeAlias = int | np.random.SeedSequence

#: The parts of a noise have random numbers of their own, from the seed with these keys.
SENSOR_KEY, AIR_KEY = 1, 2


@runtime_checkable
class NoiseModel(Protocol):
    """What draws the noise of the sensor in one run."""

    def sample(self, time: Array, seed: Seed) -> Array:
        """The noise at the sample times (s), shape (n,); the same for the same seed."""


@runtime_checkable
class DisturbanceModel(NoiseModel, Protocol):
    """A noise model that also moves the plant."""

    def disturbance(self, time: Array, seed: Seed, plant: Plant) -> Array:
        """What it adds to the output of the plant at the sample times (s), shape (n,)."""


@dataclass(frozen=True)
class FlightNoise:
    """Noise of a flight: moving air, trim, coloured and white noise of the sensor.

    Air and trim are inputs of the plant beside the command. The plant integrates and filters them,
    so their effect on the output grows slowly, and the controller acts on it. The noise of the
    sensor is added to the output that is read.

    All parts are Gaussian and independent. Air and coloured noise are Ornstein-Uhlenbeck processes,
    stationary from the first sample on; the walk of the air begins at zero there. The plant is at
    rest at the first sample: what air did to its lags before, as in a flight that is recorded from
    its middle on, is not in it.

    Parameters
    ----------
    white : float
        Standard deviation of noise of the sensor that is independent from sample to sample, in the
        unit of the output.
    air : float
        Standard deviation of gusts, in the unit of the command times the gain: m/s for a vehicle
        whose command is a velocity.
    air_time : float
        Their time constant, s, above zero where there are gusts.
    air_walk : float
        Intensity of a random walk of the air, in the unit of the air per root of a second: after t
        seconds its standard deviation is air_walk √t. It is the limit of gusts of a long time
        constant, with air √(2/air_time) = air_walk.
    trim : float
        Constant input beside the command, in the unit of the air.
    sensor : float
        Standard deviation of coloured noise of the sensor, in the unit of the output.
    sensor_time : float
        Its time constant, s, above zero where there is coloured noise. Noise with a correlation of
        a between samples h apart has the time constant -h/ln(a).

    Raises
    ------
    ValueError
        If a number is not finite, a deviation is below zero, or gusts or coloured noise have no
        time constant above zero.

    Examples
    --------
    Gusts of 0.1 m/s that last 0.3 s, over a sensor with 5 mm of noise:

    >>> import deadtime as dtm
    >>> from deadtime.experiments import FlightNoise
    >>> gusts = FlightNoise(white=0.005, air=0.1, air_time=0.3)
    >>> print(gusts)
    white noise of 0.005, wind (air) of 0.1 with a time constant of 0.3 s
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(0.85), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1.0
    ... )
    >>> still = dtm.Experiment.step(7.8).run(loop, noise=0.005, seed=1)
    >>> windy = dtm.Experiment.step(7.8).run(loop, noise=gusts, seed=1)
    >>> [round(float(run.output[-60:].std()), 3) for run in (still, windy)]
    [0.004, 0.04]
    """

    white: float = 0.0
    air: float = 0.0
    air_time: float = math.inf
    air_walk: float = 0.0
    trim: float = 0.0
    sensor: float = 0.0
    sensor_time: float = 0.0

    def __post_init__(self) -> None:
        for name in ("white", "air", "air_walk", "sensor"):
            non_negative(name, getattr(self, name))
        finite("trim", self.trim)
        for name, advice in (("air", "air_walk for a random walk"), ("sensor", "white for none")):
            lasts = getattr(self, f"{name}_time")
            if getattr(self, name) > 0.0 and not 0.0 < lasts < math.inf:
                raise ValueError(
                    f"{name}={getattr(self, name)!r} with {name}_time={lasts!r}: give a time "
                    f"constant above zero in s, or {advice}"
                )

    def __str__(self) -> str:
        parts = [f"white noise of {self.white:.3g}"]
        if self.air:
            parts.append(
                f"wind (air) of {self.air:.3g} with a time constant of {self.air_time:.2g} s"
            )
        if self.air_walk:
            parts.append(f"wind (air) as a random walk of {self.air_walk:.3g} after 1 s")
        if self.trim:
            parts.append(f"trim of {self.trim:.3g}")
        if self.sensor:
            parts.append(
                f"coloured sensor noise of {self.sensor:.3g} with a time constant of "
                f"{self.sensor_time:.2g} s"
            )
        return ", ".join(parts)

    @property
    def moves_plant(self) -> bool:
        """Whether there is air or trim."""
        return bool(self.air or self.air_walk or self.trim)

    def sample(self, time: Array, seed: Seed) -> Array:
        """Draw the noise of the sensor.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Sample times in s, increasing.
        seed : int or SeedSequence

        Returns
        -------
        ndarray, shape (n,)
        """
        found = np.zeros(time.size)
        if self.white:
            found += np.random.default_rng(seed).normal(0.0, self.white, time.size)
        if self.sensor:
            coloured = RandomProcess.of_sensor(self.sensor, self.sensor_time)
            found += coloured.drawn(time, _generator(seed, SENSOR_KEY))
        return found

    def disturbance(self, time: Array, seed: Seed, plant: Plant) -> Array:
        """Draw what air and trim add to the output of a plant at rest before the first sample.

        Air and plant move on together from sample to sample with their exact covariance.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Sample times in s, increasing.
        seed : int or SeedSequence
        plant : Plant
            Its gain does not count: the air has the unit of the command times the gain.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        ValueError
            If the plant has delays inside.
        """
        if not self.moves_plant:
            return np.zeros(time.size)
        return self.process(plant).drawn(time, _generator(seed, AIR_KEY))

    def process(self, plant: Plant) -> RandomProcess:
        """Air, trim and the plant that they move, as one random process."""
        return RandomProcess.of_air(plant, self.air, self.air_time, self.air_walk, self.trim)


#: The standard deviation of white noise, or a model.
Noise: TypeAlias = float | NoiseModel


def noise_model(noise: Noise) -> NoiseModel:
    """The model itself; white noise for a number."""
    if isinstance(noise, NoiseModel):
        return noise
    return FlightNoise(non_negative("noise", noise))


def _generator(seed: Seed, key: int) -> np.random.Generator:
    """Random numbers of one part of a noise."""
    base = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    return np.random.default_rng(
        np.random.SeedSequence(base.entropy, spawn_key=(*base.spawn_key, key))
    )
