"""Measurement noise of a simulated run: white by a number, or a model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from deadtime._base.validation import non_negative

Array = NDArray[np.float64]
Seed: TypeAlias = int | np.random.SeedSequence


@runtime_checkable
class NoiseModel(Protocol):
    """What draws the noise of one run."""

    def sample(self, time: Array, seed: Seed) -> Array:
        """The noise at the sample times (s), shape (n,); the same for the same seed."""


@dataclass(frozen=True)
class WhiteNoise:
    """Gaussian noise that is independent from sample to sample.

    Parameters
    ----------
    deviation : float
        Standard deviation, in the unit of the output.

    Examples
    --------
    >>> import numpy as np
    >>> from deadtime.experiments import WhiteNoise
    >>> noise = WhiteNoise(0.01).sample(np.arange(1000) * 0.065, seed=1)
    >>> round(float(noise.std()), 3)
    0.01
    """

    deviation: float

    def __post_init__(self) -> None:
        non_negative("deviation", self.deviation)

    def sample(self, time: Array, seed: Seed) -> Array:
        """The noise at the sample times, shape (n,)."""
        if self.deviation == 0.0:
            return np.zeros(time.size)
        return np.random.default_rng(seed).normal(0.0, self.deviation, time.size)


#: The standard deviation of white noise, or a model.
Noise: TypeAlias = float | NoiseModel


def noise_model(noise: Noise) -> NoiseModel:
    """The model itself; white noise for a number."""
    return noise if isinstance(noise, NoiseModel) else WhiteNoise(non_negative("noise", noise))
