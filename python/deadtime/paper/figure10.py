"""Figure 10: the rightmost root of the altitude loop under proportional-plus-velocity control.

u = Kp (r - z) - Kv dz/dt with Kp = 2 and Td = 0.36 s: s + (Kp + Kv s) e^(-s Td), neutral, with a
chain of roots near Re s = ln(Kv)/Td. The real velocity is a filtered derivative (38 rad/s,
damping 1), which makes the loop retarded and moves the roots: `filtered` below. At the best gain
the rightmost root is furthest left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import deadtime as dtm
from deadtime.loops import PAPER_FILTER
from deadtime.paper.comparison import Comparison
from deadtime.paper.figures6and7 import DELAY
from deadtime.paper.part import Grid, Part

#: Proportional gain of the design, 1/s.
GAIN = 2.0

#: Velocity gains of the figure, and those of a curve.
GRID, FINE = np.round(np.arange(0.1, 1.0, 0.1), 1), np.linspace(0.005, 1.0, 200)

#: Largest relative change of the rightmost root that counts as minor.
MINOR = 0.1


def velocity_loop(Kv: float, filtered: bool = True, limit: float | None = None) -> dtm.ControlLoop:
    """The altitude loop of the paper under proportional-plus-velocity control.

    Parameters
    ----------
    Kv : float
        Velocity gain.
    filtered : bool
        With the velocity through the filter of 38 rad/s, or with an ideal derivative.
    limit : float, optional
        Of the vertical speed, m/s.

    Returns
    -------
    ControlLoop
        Kp = 2, Td = 0.36 s.
    """
    smoothing = PAPER_FILTER if filtered else None
    controller = dtm.PV(Kp=GAIN, Kv=Kv, filter=smoothing)
    return dtm.ControlLoop(dtm.Integrator(), controller, delay=DELAY, limit=limit)


@dataclass(frozen=True, eq=False)
class Curve:
    """The rightmost root over the velocity gain.

    Attributes
    ----------
    gains : ndarray
        Kv.
    abscissas : ndarray
        Real part of the rightmost root, or of the chain where that lies further right, 1/s.
    best : float
        The gain with the smallest one.
    best_abscissa : float
        1/s.
    critical : float
        The gain at which the loop loses stability.
    roots : dict of float to complex
        Rightmost root for the gains of the figure, 1/s.
    """

    gains: NDArray[np.float64]
    abscissas: NDArray[np.float64]
    best: float
    best_abscissa: float
    critical: float
    roots: dict[float, complex]


@dataclass(frozen=True, eq=False)
class Figure10(Part):
    """Figure 10, reproduced, and with the filter.

    Attributes
    ----------
    ideal, filtered : Curve
        Without and with the filter of the velocity.
    delay : float
        Of both loops, s.
    turns_complex : float
        Kv above which the rightmost root of the ideal loop is a pair.
    comparisons : tuple of Comparison
        The printed numbers beside ours.
    """

    ideal: Curve
    filtered: Curve
    delay: float
    turns_complex: float

    def grids(self) -> tuple[Grid, ...]:
        """Rightmost roots and best gains, without and with the filter."""
        curves = (self.ideal, self.filtered)
        rows = [
            (f"Kv = {gain:g}", *(_in_words(curve.roots[float(gain)]) for curve in curves))
            for gain in GRID
        ]
        rows.append(
            ("best", *(f"Kv = {curve.best:.4f}: {curve.best_abscissa:.4f}" for curve in curves))
        )
        rows.append(("unstable above", *(f"Kv = {curve.critical:.4f}" for curve in curves)))
        return (
            Grid(
                "Rightmost root (1/s), Kp = 2, Td = 0.36 s",
                ("", "ideal derivative", "filtered, 38 rad/s"),
                tuple(rows),
            ),
        )

    def findings(self) -> tuple[str, ...]:
        """What the figure shows."""
        ideal, filtered = self.ideal, self.filtered
        return (
            "Kv = 0.3 is the most stable gain only if multiples of 0.1 are compared. The most "
            f"stable gain is {ideal.best:.4f}, with a spectral abscissa of "
            f"{ideal.best_abscissa:.3f} 1/s.",
            "The filter matters. At Kv = 0.3 it moves the rightmost root from "
            f"{_in_words(ideal.roots[0.3])} to {_in_words(filtered.roots[0.3])}. With the "
            f"filter, the best gain is {filtered.best:.3f} (abscissa "
            f"{filtered.best_abscissa:.3f} 1/s), and the loop is stable up to "
            f"{filtered.critical:.3f} instead of {ideal.critical:.3f}.",
        )


def figure10() -> Figure10:
    """Reproduce Figure 10.

    Returns
    -------
    Figure10

    Examples
    --------
    >>> from deadtime import paper
    >>> found = paper.figure10()
    >>> print(f"{found.ideal.best:.4f} {found.ideal.best_abscissa:.4f}")
    0.2415 -3.6841
    >>> print(f"{found.filtered.best:.3f} {found.filtered.best_abscissa:.3f}")
    0.190 -2.645
    """
    ideal, filtered = (_curve(velocity_loop(0.3, with_filter)) for with_filter in (False, True))
    complex_above = _turns_complex()
    comparisons = _compared(ideal, filtered, complex_above)
    return Figure10(ideal, filtered, DELAY, complex_above, comparisons=comparisons)


def _curve(loop: dtm.ControlLoop) -> Curve:
    from scipy.optimize import minimize_scalar

    def abscissa(gain: float) -> float:
        return loop.replace(Kv=float(gain)).spectral_abscissa()

    best = minimize_scalar(abscissa, bounds=(0.1, 0.4), method="bounded", options={"xatol": 1e-7})
    return Curve(
        gains=FINE,
        abscissas=np.array([abscissa(gain) for gain in FINE]),
        best=float(best.x),
        best_abscissa=float(best.fun),
        critical=loop.stable_range("Kv")[1],
        roots={float(gain): _rightmost(loop.replace(Kv=float(gain))) for gain in GRID},
    )


def _rightmost(loop: dtm.ControlLoop) -> complex:
    root = complex(loop.rightmost().roots[0])
    return complex(root.real, abs(root.imag))


def _turns_complex() -> float:
    """Gain at which the rightmost real root and the rightmost pair lie equally far right."""
    from scipy.optimize import brentq

    def lead(gain: float) -> float:
        found = (
            velocity_loop(gain, filtered=False)
            .characteristic()
            .roots(re=(-6.0, 2.0), im=(-20.0, 20.0))
        )
        real = found.roots[np.abs(found.roots.imag) < 1e-9].real
        pairs = found.roots[found.roots.imag > 1e-9].real
        return float(real.max() - pairs.max())

    return float(brentq(lead, 0.3, 0.7, xtol=1e-6))


def _in_words(root: complex) -> str:
    if abs(root.imag) < 1e-9:
        return f"{root.real:.4f}"
    return f"{root.real:.4f} ± {root.imag:.4f}i"


def _compared(ideal: Curve, filtered: Curve, complex_above: float) -> tuple[Comparison, ...]:
    neutral = "ideal derivative (neutral), Td = 0.36 s"
    marker = _delay_of_marker()
    on_grid = min(ideal.roots, key=lambda gain: ideal.roots[gain].real)
    moved = abs(filtered.roots[0.3].real / ideal.roots[0.3].real - 1.0)
    return (
        Comparison.of_number(
            "Fig 10",
            "rightmost root Kv=0.3",
            "-3.323",
            ideal.roots[0.3].real,
            neutral,
            note=f"The text has -3.32, which agrees. A root at -3.323 needs Td = {marker:.5f} "
            f"s. The chain of the neutral loop is at {math.log(0.3) / DELAY:.4f}",
        ),
        Comparison.of_root(
            "Sec 4.4",
            "rightmost root Kv=0.7",
            ("-0.93", "7.71"),
            ideal.roots[0.7],
            neutral,
        ),
        Comparison.of_number(
            "Sec 4.4",
            "critical Kv",
            "0.97",
            ideal.critical,
            neutral,
            note=f"with the filter {filtered.critical:.4f}",
            filtered=filtered.critical,
        ),
        Comparison.of_number(
            "Fig 10",
            "most stable Kv",
            "0.3",
            ideal.best,
            neutral,
            note=f"Among multiples of 0.1 the best gain is {on_grid:g}. With the filter the "
            f"best gain is {filtered.best:.3f}",
            abscissa=ideal.best_abscissa,
            filtered=filtered.best,
            filtered_abscissa=filtered.best_abscissa,
        ),
        Comparison.of_statement(
            "Sec 4.4",
            'filter "has only a minor effect"',
            "minor",
            holds=moved < MINOR,
            shown=f"{_in_words(ideal.roots[0.3])}, with the filter "
            f"{_in_words(filtered.roots[0.3])}, at Kv = 0.3",
            model="filter of 38 rad/s with damping 1",
            note=f"At Kv = 0.7 the filter changes the root from {ideal.roots[0.7].real:.3f} to "
            f"{filtered.roots[0.7].real:.3f}. The largest stable Kv changes from "
            f"{ideal.critical:.4f} to {filtered.critical:.4f}, and the best gain from "
            f"{ideal.best:.4f} to {filtered.best:.4f}. The loop changes from neutral to "
            "retarded",
            computed=filtered.roots[0.3],
        ),
        Comparison.of_statement(
            "Sec 4.4",
            "roots move right for Kv >",
            "0.5",
            holds=abs(ideal.best - 0.5) < 0.05,
            shown=f"{ideal.best:.4f}",
            model=neutral,
            note=f"at Kv = {complex_above:.3f} the rightmost root changes from a real root to a "
            "complex pair",
            computed=ideal.best,
            turns_complex=complex_above,
        ),
    )


def _delay_of_marker() -> float:
    """The delay at which the rightmost root is that of the figure's marker, s."""
    from scipy.optimize import brentq

    def off(delay: float) -> float:
        loop = velocity_loop(0.3, filtered=False).replace(delay=delay)
        return loop.spectral_abscissa() + 3.323

    return float(brentq(off, DELAY, DELAY + 1e-3, xtol=1e-9))
