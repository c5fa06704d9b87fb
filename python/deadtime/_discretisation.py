"""A derivative filter that runs in samples, as a computer runs it.

The filter x' = F x + G v, d = C x, driven by the samples v_k of what it filters, becomes

    x_{k+1} = Fd x_k + Gd v_k,   d_k = Cd x_k + Dd v_k.

``"hold"``: v held between samples, exact for it; ``"tustin"``: the trapezoidal rule, s for
(2/Ts)(z - 1)/(z + 1); ``"backward"``: Euler's implicit rule, s for (z - 1)/(Ts z).
Åström & Wittenmark, Computer-Controlled Systems (3rd ed. 1997), sections 2.3 and 8.2.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, TypeAlias, cast, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete

__all__ = ["Discretisation", "SampledFilter", "checked", "discretised"]

Vector = NDArray[np.float64]

Discretisation: TypeAlias = Literal["hold", "tustin", "backward"]

_SCIPY = {"hold": "zoh", "tustin": "bilinear", "backward": "backward_diff"}


class SampledFilter(NamedTuple):
    """Fd, Gd, Cd, Dd."""

    F: Vector
    G: Vector
    C: Vector
    D: float


def discretised(
    F: Vector, G: Vector, C: Vector, sample_time: float, method: Discretisation
) -> SampledFilter:
    """Return the filter of a sample time in s by one of the methods."""
    system = (F, G[:, None], C[None, :], np.zeros((1, 1)))
    found = cast(Any, cont2discrete)(system, sample_time, method=_SCIPY[method])
    return SampledFilter(found[0], found[1][:, 0], found[2][0], float(found[3][0, 0]))


def checked(method: str | None) -> Discretisation | None:
    """Return the method, or raise where there is none of that name."""
    if method is not None and method not in get_args(Discretisation):
        names = ", ".join(repr(name) for name in get_args(Discretisation))
        raise ValueError(f"discretisation={method!r}: give one of {names}, or None")
    return cast("Discretisation | None", method)
