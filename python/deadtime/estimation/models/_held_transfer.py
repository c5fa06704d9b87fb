"""Transfer function from held commands to samples of an integrator with lag and delay.

The unit step response of the plant gain/(s (lag s + 1)) is S(t) = t - lag (1 - e^(-t/lag)). A
command held for one sample time h is a step up and a step down, so with a delay of (d + f) h,
0 <= f < 1, g = 1 - f and q = 1/z (modified z-transform, Jury 1964),

    H(z) = q^(d+1) [ h q/(1 - q) + g h - lag + lag e^(-g h/lag) (1 - q)/(1 - e^(-h/lag) q) ],

exact for every delay, whole number of samples or not.
"""

from __future__ import annotations

import math
from typing import overload

import numpy as np
from numpy.typing import NDArray

__all__ = ["held_transfer"]

Complex = NDArray[np.complex128]


@overload
def held_transfer(z: complex, delay: float, lag: float, sample_time: float) -> complex: ...
@overload
def held_transfer(z: Complex, delay: float, lag: float, sample_time: float) -> Complex: ...
def held_transfer(
    z: complex | Complex, delay: float, lag: float, sample_time: float
) -> complex | Complex:
    """H(z) for a gain of one; delay, lag and sample time in s."""
    q = 1.0 / z
    whole = math.floor(delay / sample_time)
    rest = 1.0 - (delay / sample_time - whole)
    ramp = sample_time * q / (1.0 - q) + rest * sample_time
    if lag > 0.0:
        late = math.exp(-rest * sample_time / lag) * (1.0 - q)
        ramp = ramp - lag + lag * late / (1.0 - math.exp(-sample_time / lag) * q)
    return ramp * q ** (whole + 1)
