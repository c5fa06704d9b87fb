"""Margins of a sampled loop, from all crossings of its loop gain on the upper unit circle.

The poles are continuous functions of a factor k on L and of a rotation e^(-j phi) of it, so that a
stable loop first loses stability where a pole reaches the unit circle:

    k = 1/abs(L) where L(e^(j angle)) is real and negative (angles 0 and pi included),
    phi = pi + arg L where abs(L) = 1.

A further delay changes the fraction of a sample and with it L itself, so the delay margin does not
follow from L: it is the first loss of stability of the loop as its delay grows.

Crossings are searched between angles that separate poles, zeros and turns of the delay, and around
the extrema between them; they are refined to rounding. A pair of crossings between two angles whose
extremum does not show at the angles would be missed: this is no proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from deadtime.loops._sampled_gain import SampledLoopGain
from deadtime.systems import Margins

Vector = NDArray[np.float64]

#: Relative tolerance of the angle of an extremum between two angles: a smaller one finds closer
#: pairs of crossings and takes longer.
_EXTREMUM = 1e-9

#: Absolute and relative tolerance of the angle of a crossing, about the rounding error.
_CROSSING, _CROSSING_RELATIVE = 1e-15, 1e-14


def sampled_margins(
    gain: SampledLoopGain, stable: bool, further_delay: tuple[float, float]
) -> Margins:
    """Margins of the loop gain; `further_delay` is the delay margin and its frequency."""
    period = gain.sample_time

    def side(angle: Vector) -> Vector:
        values = gain.at(angle)
        return values.imag / np.abs(values)

    crossovers, turn = _gain_crossovers(gain)
    degrees = np.degrees(np.where(turn > np.pi, turn - 2.0 * np.pi, turn))

    # L is real at both ends of the half circle, unless it has a pole at angle 0.
    inner = gain.angles[:-1]
    ends = [np.pi] if gain.integrators else [0.0, np.pi]
    places = np.unique(np.append(_crossings(side, inner), ends))
    real = gain.at(places).real
    places, factors = places[real < 0.0], -1.0 / real[real < 0.0]

    nan, omegas = math.nan, places / period
    up, up_at = _first_loss(factors, omegas, factors > 1.0, 1.0, math.inf)
    down, down_at = _first_loss(factors, omegas, factors < 1.0, -1.0, 0.0)
    turned, turned_at = _first_loss(
        np.abs(degrees), crossovers / period, np.isfinite(degrees), 1.0, math.inf
    )
    late, late_at = further_delay
    if not stable:
        up = down = turned = up_at = down_at = turned_at = nan
    return Margins(
        stable=stable,
        gain_margin=up,
        gain_reduction=down,
        phase_margin=turned,
        delay_margin=late,
        gain_margin_omega=up_at,
        gain_reduction_omega=down_at,
        phase_margin_omega=turned_at,
        delay_margin_omega=late_at,
        gain_crossovers=crossovers / period,
        phase_margins=degrees,
        delay_margins=np.zeros(0),
        phase_crossovers=omegas,
        gain_margins=factors,
        searched=(math.inf, math.inf),
    )


def _gain_crossovers(gain: SampledLoopGain) -> tuple[Vector, Vector]:
    """Angles at which abs(L) = 1, and the rotation phi in [0, 2 pi) that moves L to -1 there."""
    found = _crossings(lambda angle: np.log(np.abs(gain.at(angle))), gain.angles)
    return found, np.mod(np.pi + np.angle(gain.at(found)), 2.0 * np.pi)


def _crossings(f: Callable[[Vector], Vector], angles: Vector) -> Vector:
    """Zeros of `f` between `angles`, including pairs around an extremum between two of them."""
    from scipy.optimize import brentq, minimize_scalar

    values = f(angles)

    def one(angle: float) -> float:
        return float(f(np.array([angle]))[0])

    brackets = [(angles[i], angles[i + 1]) for i in np.flatnonzero(values[:-1] * values[1:] < 0.0)]
    sizes = np.abs(values)
    lowest = (sizes[1:-1] <= sizes[:-2]) & (sizes[1:-1] <= sizes[2:])
    same = (values[1:-1] * values[:-2] > 0.0) & (values[1:-1] * values[2:] > 0.0)
    for i in np.flatnonzero(lowest & same) + 1:
        sign = math.copysign(1.0, values[i])
        found = minimize_scalar(
            lambda angle, sign=sign: sign * one(angle),
            bounds=(angles[i - 1], angles[i + 1]),
            method="bounded",
            options={"xatol": _EXTREMUM * angles[i]},
        )
        if found.fun < 0.0:
            brackets += [(angles[i - 1], found.x), (found.x, angles[i + 1])]
    zeros = [
        brentq(one, low, high, xtol=_CROSSING, rtol=_CROSSING_RELATIVE) for low, high in brackets
    ]
    exact = angles[values == 0.0]
    return np.unique(np.append(np.array(zeros, dtype=np.float64), exact))


def _first_loss(
    values: Vector, places: Vector, allowed: NDArray[np.bool_], sign: float, none: float
) -> tuple[float, float]:
    """The smallest allowed value (with sign -1 the largest) and its entry of `places`."""
    if not allowed.any():
        return none, math.nan
    chosen = np.flatnonzero(allowed)
    best = chosen[np.argmin(sign * values[chosen])]
    return float(values[best]), float(places[best])
