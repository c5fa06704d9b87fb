"""Margins of a feedback loop, delay margin among them, from all crossings of the loop gain.

With the loop gain L = n/d, the closed loop has the characteristic function d + n. Its roots move
continuously with a factor k on L, a turn e^{-j phi} or a further delay T, so that a stable loop
first loses stability where a root comes to the axis:

    k = 1/|L| where L is real and negative (omega = 0 among these places),
    phi = pi + arg L and T = phi / omega where |L| = 1, phi taken within [0, 2 pi).

|d|^2 = |n|^2 is free of the delays if n and d have one each; with several it is an
exponential polynomial. Both, and Im(n conj d) = 0, are solved by `zeros_between`, which misses
nothing, up to a frequency beyond which the moduli of the coefficients show |L| to stay below
what matters. If L does not vanish for high frequencies the loop is neutral, and stability is also
lost where strong stability is:

    |a_0 + k b_0| <= sum_{i>0} |a_i + k b_i|,  and for any T > 0 if
    |a_0| <= sum_{i>0} |a_i| + sum_i |b_i|,

with a_i, b_i the coefficients of the highest power of s in d and n by delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.page import table, table_row
from deadtime.roots import QuasiPolynomial
from deadtime.roots._crossovers import end_or_corner, gain_crossovers, span
from deadtime.roots._frequency import (
    OnAxis,
    RealFunction,
    powers_of_s,
    ratio_rows,
    without_common_power,
    without_powers,
    zeros_between,
)

__all__ = ["Margins", "first_loss", "margins"]

Vector = NDArray[np.float64]

# Limits of the search for phase crossovers where no frequency bounds them, as when delays enter the
# phase and none of them turns it through 180 degrees: a gain below _SMALLEST_GAIN, or _TURNS times
# the crossover frequency or the frequency at which the longest delay turns the phase once.
_SMALLEST_GAIN = 1e-8
_TURNS = 1e3


@dataclass(frozen=True, eq=False, repr=False)
class Margins(ReadOnlyArrays):
    """How much a feedback loop stands before it becomes unstable, and every crossing behind it.

    The loop is one with negative unit feedback around the loop gain L. The margins are NaN if it
    is not stable as it is; the crossings are listed all the same.

    Attributes
    ----------
    stable : bool
        Is the closed loop stable, for a neutral one also under small changes of its delays?
    gain_margin : float
        Smallest factor above one on L that makes the loop unstable; inf if there is none.
    gain_reduction : float
        Largest factor below one that does so; 0 if there is none.
    phase_margin : float
        Smallest turn of L, either way, that does so, in degrees; inf if there is none.
    delay_margin : float
        Smallest further delay in the loop that does so, in s; inf if there is none, 0 if any does.
    gain_margin_omega, gain_reduction_omega, phase_margin_omega, delay_margin_omega : float
        Where they are found, in rad/s; NaN where there is no such place, inf where a neutral loop
        loses strong stability.
    gain_crossovers : ndarray, shape (n,)
        Every frequency above zero at which abs(L) = 1, in rad/s.
    phase_margins, delay_margins : ndarray, shape (n,)
        What L stands at each of these: degrees in (-180, 180], and s.
    phase_crossovers : ndarray, shape (m,)
        Frequencies from zero up at which L is real and negative, in rad/s.
    gain_margins : ndarray, shape (m,)
        1/abs(L) there.
    searched : tuple of float
        Up to which frequencies, in rad/s, the gain crossovers and the phase crossovers are all
        listed; inf if there are no more. In a stable loop abs(L) is smaller beyond the second one
        than at any phase crossover that decides a margin; if it is finite and `gain_margin`
        infinite, no crossing was found up to there, and none is expected beyond.

    Examples
    --------
    >>> from deadtime import delay, s
    >>> found = (2.0 / s * delay(0.36)).margin()
    >>> found
    <Margins: gain 2.182 at 4.363 rad/s, phase 48.75° at 2 rad/s, delay 0.4254 s at 2 rad/s>
    >>> bool(abs(found.delay_margin - (3.141592653589793 / 4 - 0.36)) < 1e-15)
    True
    """

    stable: bool
    gain_margin: float
    gain_reduction: float
    phase_margin: float
    delay_margin: float
    gain_margin_omega: float
    gain_reduction_omega: float
    phase_margin_omega: float
    delay_margin_omega: float
    gain_crossovers: Vector
    phase_margins: Vector
    delay_margins: Vector
    phase_crossovers: Vector
    gain_margins: Vector
    searched: tuple[float, float]

    def _delay_margin(self) -> float:
        """The delay margin of a loop that must be stable."""
        if not self.stable:
            raise ValueError("the loop is not stable as it is: it has no delay margin")
        return self.delay_margin

    def _repr_html_(self) -> str:
        if not self.stable:
            return table(("the closed loop is not stable as it is",), (), "Margins")
        rows = [
            table_row(
                (name, f"{value:.6g}{unit}", "" if math.isnan(omega) else f"{omega:.6g}"), "td", 3
            )
            for name, value, unit, omega in self._four()
        ]
        return table(("margin", "value", "at rad/s"), rows, "Margins")

    def _four(self) -> tuple[tuple[str, float, str, float], ...]:
        """Name, value, unit and frequency of each margin."""
        return (
            ("gain", self.gain_margin, "", self.gain_margin_omega),
            ("gain reduction", self.gain_reduction, "", self.gain_reduction_omega),
            ("phase", self.phase_margin, "°", self.phase_margin_omega),
            ("delay", self.delay_margin, " s", self.delay_margin_omega),
        )

    def __repr__(self) -> str:
        if not self.stable:
            return "<Margins: none, the closed loop is not stable as it is>"
        parts = []
        for name, value, unit, omega in self._four():
            if name == "gain reduction" and value == 0.0:
                continue
            where = "" if math.isnan(omega) else f" at {omega:.4g} rad/s"
            number = "any" if value == math.inf else f"{value:.4g}{unit}"
            parts.append(f"{name} {number}{where}")
        return f"<Margins: {', '.join(parts)}>"


def margins(n: QuasiPolynomial, d: QuasiPolynomial) -> Margins:
    """Margins of the loop gain n/d."""
    _refuse_what_has_none(n, d)
    stable = (d + n).is_stable()
    a, b = _by_delay(d, d.degree), _by_delay(n, d.degree)

    crossovers, all_gain = gain_crossovers(n, d)
    at = n(1j * crossovers) / d(1j * crossovers)
    turn = np.mod(np.pi + np.angle(at), 2.0 * np.pi)
    delays = turn / crossovers
    degrees = np.degrees(np.where(turn > np.pi, turn - 2.0 * np.pi, turn))

    last = crossovers.max(initial=0.0)
    places, gains, all_phase = _phase_crossovers(n, d, math.inf if stable else last)
    factors = 1.0 / gains

    up, up_at = first_loss(factors, places, factors > 1.0, 1.0, math.inf)
    down, down_at = first_loss(factors, places, factors < 1.0, -1.0, 0.0)
    most, least = _strong_range(a, b)
    if most <= up and most < math.inf:
        up, up_at = most, math.inf
    if least >= down and least > 0.0:
        down, down_at = least, math.inf
    any_delay = bool(b) and _lead(a) <= _rest(a) + sum(abs(v) for v in b.values())
    late, late_at = first_loss(delays, crossovers, delays >= 0.0, 1.0, math.inf)
    if any_delay:
        late, late_at = 0.0, math.inf
    turned, turned_at = first_loss(np.abs(degrees), crossovers, delays >= 0.0, 1.0, math.inf)
    if not stable:
        up = down = turned = late = math.nan
        up_at = down_at = turned_at = late_at = math.nan
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
        gain_crossovers=crossovers,
        phase_margins=degrees,
        delay_margins=delays,
        phase_crossovers=places,
        gain_margins=factors,
        searched=(all_gain, all_phase),
    )


def _refuse_what_has_none(n: QuasiPolynomial, d: QuasiPolynomial) -> None:
    if not d.coefficients.any():
        raise ValueError("the loop gain is infinite everywhere: its denominator is zero")
    if n.degree > d.degree:
        raise ValueError(
            f"the loop gain grows with frequency (degree {n.degree} over {d.degree}): any delay, "
            "however small, makes such a loop unstable, so it has no margins; add the roll-off "
            "that the real loop has, for example a DerivativeFilter"
        )
    if d.kind == "advanced" or n.delays[0] < d.delays[0]:
        raise ValueError(
            "the loop gain answers its input before it comes (the smallest delay of the "
            f"denominator is {d.delays[0]:g} s, that of the numerator {n.delays[0]:g} s, and the "
            f"denominator is {d.kind}): such a loop is not causal and has no margins"
        )


def _phase_crossovers(
    n: QuasiPolynomial, d: QuasiPolynomial, far: float
) -> tuple[Vector, Vector, float]:
    """Frequencies with n/d < 0, |n/d| there, and up to where they are all.

    They go at least up to where the gain is below that of one of them that is below one, or, if
    it comes first, some turns of the delays beyond `far`.
    """
    empty = np.zeros(0)
    if not n.coefficients.any():
        return empty, empty, math.inf
    p, q = powers_of_s(n), powers_of_s(d)
    n, d = without_powers(n, p), without_powers(d, q)
    # s^(p-q) on the axis is omega^(p-q), which is positive, times quarter turns.
    rows = ratio_rows(n, d, p - q)
    f = RealFunction(without_common_power(rows))
    end = _last_real(rows)
    last, constant = (math.inf, False) if end is None else end
    shortest = 2.0 * np.pi / max(span(n, d), 1e-300)
    places = [0.0] if p == q else []
    enough = min(max(end_or_corner(n, d, p - q, 1.0), shortest), 10.0 * max(far, shortest))
    low, high = 0.0, min(last, enough)
    while True:
        if high > low and not constant:
            places += zeros_between(f, low, high).tolist()
        omega = np.array(places)
        gains = np.zeros(0)
        if omega.size:
            with np.errstate(divide="ignore", invalid="ignore"):
                real = np.real((1.0, 1j, -1.0, -1j)[(p - q) % 4] * n(1j * omega) / d(1j * omega))
            real = real * omega ** float(p - q)
            # Where the phase jumps, at a pole or zero on the axis, it does not cross.
            negative = (real < 0.0) & ~_vanishes(n, omega) & ~_vanishes(d, omega)
            places, omega = omega[negative].tolist(), omega[negative]
            gains = -real[negative]
        if high >= last:
            return omega, gains, math.inf
        if far < math.inf:
            return omega, gains, high
        below = gains[gains < 1.0]
        if below.size and end_or_corner(n, d, p - q, float(below.max())) <= high:
            return omega, gains, high
        if high >= end_or_corner(n, d, p - q, _SMALLEST_GAIN) or high > _TURNS * max(
            end_or_corner(n, d, p - q, 1.0), shortest
        ):
            return omega, gains, high
        low, high = high, min(last, 2.0 * high)


def _vanishes(h: QuasiPolynomial, omega: Vector) -> NDArray[np.bool_]:
    """Whether h(j omega) is zero but for rounding, that of omega included."""
    on_axis = OnAxis(h, 0.0)
    value, steep, _ = on_axis.bounds(omega)
    return np.asarray(
        np.abs(on_axis(omega)) <= 4.0 * on_axis.rounding(omega) * (value + omega * steep)
    )


def _last_real(rows: dict[float, NDArray[np.complex128]]) -> tuple[float, bool] | None:
    """Bound on the frequencies at which a ratio without delays is real (Fujiwara).

    With True if it is real everywhere. None if delays stay in the ratio: there is no bound then.
    """
    if any(delta != 0.0 for delta in rows):
        return None
    imaginary = rows[0.0].imag
    used = np.flatnonzero(imaginary)
    if used.size == 0:
        return 0.0, True
    if used.size == 1:
        return 0.0, False
    top, below = used[-1], used[:-1]
    ratios = np.abs(imaginary[below] / imaginary[top]) ** (1.0 / (top - below))
    return float(2.0 * ratios.max()), False


def _by_delay(h: QuasiPolynomial, power: int) -> dict[float, float]:
    """Coefficients of one power of s that are not zero, by their delay."""
    if power > h.degree:
        return {}
    return {
        float(tau): float(row[power])
        for tau, row in zip(h.delays, h.coefficients, strict=True)
        if row[power] != 0.0
    }


def _lead(a: dict[float, float]) -> float:
    return abs(a[min(a)])


def _rest(a: dict[float, float]) -> float:
    return sum(abs(value) for value in a.values()) - _lead(a)


def _strong_range(a: dict[float, float], b: dict[float, float]) -> tuple[float, float]:
    """The factors above and below one on b at which strong stability is lost; inf and 0 if none.

    |a_0 + k b_0| - sum |a_i + k b_i| is linear in k between the zeros of its terms.
    """
    if not b:
        return math.inf, 0.0
    taus = sorted({*a, *b})
    pairs = [(a.get(tau, 0.0), b.get(tau, 0.0)) for tau in taus]

    def reserve(k: float) -> float:
        sizes = [abs(x + k * y) for x, y in pairs]
        return sizes[0] - sum(sizes[1:])

    bends = [-x / y for x, y in pairs if y != 0.0]

    def first(nodes: list[float], none: float) -> float:
        for k, following in pairwise(nodes):
            start, end = reserve(k), reserve(following)
            if start <= 0.0:
                return k
            if end <= 0.0:
                return k + (following - k) * start / (start - end)
        return none

    above = sorted(k for k in bends if k > 1.0)
    # Beyond the last bend the reserve is linear: one point farther out shows its slope.
    far = above[-1] if above else 1.0
    slope = reserve(far + 1.0) - reserve(far)
    last = far + (1.0 if slope >= 0.0 else 1.0 + max(reserve(far), 0.0) / -slope)
    below = sorted((k for k in bends if 0.0 < k < 1.0), reverse=True)
    return first([1.0, *above, last], math.inf), first([1.0, *below, 0.0], 0.0)


def first_loss(
    values: Vector, places: Vector, allowed: NDArray[np.bool_], sign: float, none: float
) -> tuple[float, float]:
    """The smallest (or with sign -1 the largest) allowed value and its place."""
    if not allowed.any():
        return none, math.nan
    chosen = np.flatnonzero(allowed)
    best = chosen[np.argmin(sign * values[chosen])]
    return float(values[best]), float(places[best])
