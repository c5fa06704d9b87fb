"""Measurement noise of a simulated run: white by a number, or a model; its effect in the loop.

Where a controller acts on the error r - y alone, noise on the output is noise on the reference
with the other sign, limit and hold included. Where it differentiates the output alone, as PV
does, the noise goes through the filter of the derivative as well: u = Kp (r - y - n) - Kv H (y + n)
is what it makes of y under the reference r - n - (Kv/Kp) H n, computed exactly on the samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from deadtime._base.validation import non_negative
from deadtime.loops import PV, ControlLoop, DerivativeFilter
from deadtime.loops._derivative_filter import discretised

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


def reference_shift(error: Array, loop: ControlLoop) -> Array:
    """What the reference has to be lowered by to have the effect of noise on the output."""
    controller = loop.controller
    gains, smooth = controller.gains, controller._filter
    slope = gains.get("Kd", gains.get("Kv", 0.0))
    if slope == 0.0:
        return error
    if smooth is None:
        raise ValueError(
            "noise has no ideal derivative: give the controller a DerivativeFilter, or keep the "
            "noise out of the loop (noise_in_loop=False)"
        )
    if not isinstance(controller, PV):
        return error
    if loop.sample_time is None:
        raise ValueError(
            "noise through the filter of a PV controller is computed on samples: give the loop a "
            "sample_time, or keep the noise out of the loop (noise_in_loop=False)"
        )
    if controller.Kp == 0.0:
        raise ValueError(
            "Kp=0: the reference does not enter, so noise cannot be added to it; give a Kp other "
            "than zero, or keep the noise out of the loop (noise_in_loop=False)"
        )
    return error + slope / controller.Kp * _derivative(error, smooth, loop.sample_time)


def _derivative(error: Array, smooth: DerivativeFilter, sample_time: float) -> Array:
    """The filtered derivative of noise at the samples.

    The noise is held from sample to sample, for which the hold discretisation of a continuous
    filter is exact.
    """
    from scipy import signal

    omega, damping = smooth.omega, smooth.damping
    found = discretised(
        np.array([[0.0, omega], [-omega, -2.0 * damping * omega]]),
        np.array([0.0, omega]),
        np.array([0.0, omega]),
        sample_time,
        smooth.discretisation or "hold",
    )
    num, den = signal.ss2tf(found.F, found.G[:, None], found.C[None, :], np.array([[found.D]]))
    return np.asarray(signal.lfilter(num[0], den, error), dtype=np.float64)
