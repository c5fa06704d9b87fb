"""Figures 8 and 9: proportional control at the measured delay, Kp = 4 stable and 5 not.

The responses (Figure 8) and the roots (Figure 9) of the altitude loop at Td = 0.36 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import deadtime as dtm
from deadtime.paper.comparison import Comparison
from deadtime.paper.figures6and7 import DELAY
from deadtime.paper.part import Grid, Part
from deadtime.paper.table2 import SAMPLE_TIME, altitude_loop
from deadtime.systems import Response

GAINS = (4.0, 5.0)

#: Branches of W of which roots are shown.
BRANCHES = np.arange(-5, 5)


@dataclass(frozen=True, eq=False)
class Figure8(Part):
    """Figure 8: responses at the measured delay.

    Attributes
    ----------
    responses : dict of float to Response
        Exact step responses without the limit, over Kp.
    limit : float
        Kp at which the loop loses stability.
    held_limit : float
        The same with the command held for a sample of 65 ms.
    comparisons : tuple of Comparison
        The printed limit beside ours.
    """

    responses: dict[float, Response]
    limit: float
    held_limit: float

    def grids(self) -> tuple[Grid, ...]:
        """Both limits."""
        return (
            Grid(
                "Kp at which the loop becomes unstable, Td = 0.36 s",
                ("loop", "Kp"),
                (
                    ("continuous", f"{self.limit:.4f}"),
                    ("each command held for 65 ms", f"{self.held_limit:.4f}"),
                ),
            ),
        )

    def findings(self) -> tuple[str, ...]:
        """What the figure shows."""
        margin = 100.0 * (self.held_limit / GAINS[0] - 1.0)
        return (
            f"Kp = 4 is stable. In the sampled loop Kp = 4 is only {margin:.1f} % below the limit. "
            f"With the hold of 65 ms the limit is {self.held_limit:.3f} instead of "
            f"{self.limit:.3f}.",
        )


def figure8() -> Figure8:
    """Reproduce the responses at Kp = 4 and 5.

    Returns
    -------
    Figure8

    Examples
    --------
    >>> from deadtime import paper
    >>> found = paper.figure8()
    >>> round(found.limit, 4), round(found.held_limit, 3)
    (4.3633, 4.024)
    """
    loop = altitude_loop(DELAY, limit=None)
    time = np.linspace(0.0, 10.0, 1001)
    limit = loop.stable_range("Kp")[1]
    return Figure8(
        responses={gain: loop.replace(Kp=gain).simulate(time) for gain in GAINS},
        limit=limit,
        held_limit=loop.replace(sample_time=SAMPLE_TIME).stable_range("Kp")[1],
        comparisons=(
            Comparison.of_limits(
                "Sec 4.3",
                "critical Kp",
                "5",
                GAINS,
                limit,
                "π/(2 Td)",
                note="Kp = 5 is the smallest whole number with an unstable loop; with Kp = 4 it "
                "is stable",
            ),
        ),
    )


@dataclass(frozen=True, eq=False)
class Figure9(Part):
    """Figure 9: roots at the measured delay.

    Attributes
    ----------
    roots : dict of float to ndarray of complex
        Roots of several branches of W, 1/s, over Kp.
    comparisons : tuple of Comparison
        What is said of their stability beside ours.
    """

    roots: dict[float, NDArray[np.complex128]]


def figure9() -> Figure9:
    """Reproduce the roots at Kp = 4 and 5.

    Returns
    -------
    Figure9

    Examples
    --------
    >>> from deadtime import paper
    >>> [row.shown for row in paper.figure9().comparisons]
    ['-0.1715 ± 4.2513i', '0.2700 ± 4.5288i']
    """
    compared = []
    for gain in GAINS:
        root = complex(dtm.dde_roots(0.0, -gain, DELAY))
        stable = gain == GAINS[0]
        compared.append(
            Comparison.of_statement(
                "Fig 9",
                f"Kp={gain:g} stable?",
                "stable" if stable else "unstable",
                holds=(root.real < 0.0) is stable,
                shown=f"{root.real:.4f} ± {root.imag:.4f}i",
                model="W0, Td = 0.36 s",
                computed=root,
            )
        )
    return Figure9(
        {gain: np.asarray(dtm.dde_roots(0.0, -gain, DELAY, BRANCHES)) for gain in GAINS},
        comparisons=tuple(compared),
    )
