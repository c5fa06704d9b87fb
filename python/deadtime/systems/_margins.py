"""Margins of a feedback loop, delay margin among them; the native core finds the crossings."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

import deadtime.systems._native as native
from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays
from deadtime.roots import QuasiPolynomial
from deadtime.systems._native import loop_margins


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
    hidden : ndarray of complex
        Roots of the closed loop that are not left of the imaginary axis and do not count for
        `stable`, because numerator and denominator of L have them in common.
    max_sensitivity, max_sensitivity_omega : float
        Ms, the largest abs(S) over frequency of the sensitivity S = 1/(1 + L), and where it is, in
        rad/s; inf where it is only come close to at high frequencies. 1/Ms is the least distance of
        L from -1.
    max_complementary_sensitivity, max_complementary_sensitivity_omega : float
        Mt, the same of T = L/(1 + L).
    disk_margin, disk_margin_omega : float
        The disk margin alpha = 1/max abs((S - T)/2) (Seiler, Packard and Gahinet 2020, eq. 13 with
        skew 0), and where it is least. L may be multiplied by every number of the disk with the
        diameter from (2 - alpha)/(2 + alpha) to (2 + alpha)/(2 - alpha).
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
    >>> round(found.max_sensitivity, 3), round(found.max_sensitivity_omega, 3)
    (2.048, 3.508)
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
    gain_crossovers: Array
    phase_margins: Array
    delay_margins: Array
    phase_crossovers: Array
    gain_margins: Array
    searched: tuple[float, float]
    hidden: NDArray[np.complex128]
    max_sensitivity: float
    max_sensitivity_omega: float
    max_complementary_sensitivity: float
    max_complementary_sensitivity_omega: float
    disk_margin: float
    disk_margin_omega: float

    def _delay_margin(self) -> float:
        """The delay margin of a loop that must be stable."""
        if not self.stable:
            raise ValueError(
                "the closed loop is not stable even without further delay, so it has no "
                "delay margin"
            )
        return self.delay_margin

    def _repr_markdown_(self) -> str | None:
        if not self.stable:
            return None
        rows = [("margin", "value", "at rad/s"), ("---",) * 3]
        for name, value, unit, omega in self._listed():
            at = "" if math.isnan(omega) else f"{omega:.6g}"
            rows.append((name, f"{value:.6g}{unit}", at))
        return "\n".join(f"| {' | '.join(row)} |" for row in rows)

    def _listed(self) -> tuple[tuple[str, float, str, float], ...]:
        """Name, value, unit and frequency of each margin."""
        return (
            ("gain", self.gain_margin, "", self.gain_margin_omega),
            ("gain reduction", self.gain_reduction, "", self.gain_reduction_omega),
            ("phase", self.phase_margin, "°", self.phase_margin_omega),
            ("delay", self.delay_margin, " s", self.delay_margin_omega),
            ("Ms", self.max_sensitivity, "", self.max_sensitivity_omega),
            (
                "Mt",
                self.max_complementary_sensitivity,
                "",
                self.max_complementary_sensitivity_omega,
            ),
            ("disk", self.disk_margin, "", self.disk_margin_omega),
        )

    def __repr__(self) -> str:
        if not self.stable:
            return "<Margins: none, the closed loop is not stable as it is>"
        parts = []
        for name, value, unit, omega in self._listed()[:4]:
            if name == "gain reduction" and value == 0.0:
                continue
            where = "" if math.isnan(omega) else f" at {omega:.4g} rad/s"
            number = "any" if value == math.inf else f"{value:.4g}{unit}"
            parts.append(f"{name} {number}{where}")
        if len(self.hidden):
            modes = ", ".join(f"{mode:.6g}" for mode in self.hidden)
            parts.append(f"hidden modes at {modes}")
        return f"<Margins: {', '.join(parts)}>"


def margins(n: QuasiPolynomial, d: QuasiPolynomial, *, all_modes: bool) -> Margins:
    """Margins of the loop gain n/d; with `all_modes`, what n and d have in common counts."""
    return margins_of(loop_margins(n._native, d._native, all_modes))


def margins_of(found: native.Margins) -> Margins:
    """Margins as the kernel returns them."""
    return Margins(**{field.name: getattr(found, field.name) for field in fields(Margins)})
