"""Figure 3: the gain at which the integrator with Td = 0.1 s loses stability.

By its roots (right) it is pi/(2 Td) = 15.708. The simulation on the left is said to be stable at 18
and unstable at 19; no converged simulation is. Coarse fixed steps shift the limit; the steps
that shift it so far are found by bisection over the gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import deadtime as dtm
from deadtime.paper.comparison import Comparison
from deadtime.paper.part import Grid, Part
from deadtime.systems import Response

DELAY = 0.1

#: Lengths of step of a coarse simulation, s.
STEPS = (0.001, 0.02, 0.04, 0.065, 0.07, 0.075, 0.08, 0.085, 0.09)

#: Sample time of a loop with a hold, s, for comparison: a hold lowers the limit.
HOLD = 0.065

#: Relative width at which the bisection for a limit ends.
WIDTH = 1e-4

#: An error that has fallen below this has decayed.
DECAYED = 1e-9


@dataclass(frozen=True, eq=False)
class Figure3(Part):
    """Figure 3, reproduced.

    Attributes
    ----------
    responses : dict of float to Response
        Exact step responses for the gains of the paper.
    rightmost : dict of float to complex
        Rightmost root over the gain, 1/s.
    limit : float
        Gain at which the loop loses stability.
    held_limit : float
        The same with the command held for 65 ms.
    coarse_limits : dict of float to float
        The same of simulations in fixed steps, over the length of the step in s.
    comparisons : tuple of Comparison
        The printed numbers beside ours.
    """

    responses: dict[float, Response]
    rightmost: dict[float, complex]
    limit: float
    held_limit: float
    coarse_limits: dict[float, float]

    def grids(self) -> tuple[Grid, ...]:
        """Limits of coarse simulations, and roots."""
        return (
            Grid(
                "Limit of stability of a simulation in fixed steps (ode3)",
                ("step", "critical K"),
                tuple((f"{1e3 * h:g} ms", f"{k:.2f}") for h, k in self.coarse_limits.items()),
            ),
            Grid(
                "Rightmost roots at Td = 0.1 s",
                ("K", "root"),
                tuple(
                    (f"{gain:g}", f"{root.real:.4f} ± {root.imag:.4f}i")
                    for gain, root in self.rightmost.items()
                    if gain in self.responses
                ),
            ),
        )

    def findings(self) -> tuple[str, ...]:
        """What the figure shows."""
        fits = [f"{1e3 * h:g}" for h, k in self.coarse_limits.items() if 18.0 < k <= 19.0]
        low, high = (1e3 * math.pi / (2.0 * gain) for gain in (19.0, 18.0))
        return (
            f"The loop becomes unstable at K = {self.limit:.3f}. A simulation that is stable at "
            f"18 but not at 19 has a delay of {low:.1f} to {high:.1f} ms instead of 100 ms. Or "
            f"its steps are too coarse, such as {', '.join(fits)} ms.",
            f"If each command is held for 65 ms, the limit is {self.held_limit:.2f}. So a limit "
            "without the hold is too high, which is unsafe.",
        )


def coarse_limit(step: float, solver: str = "ode3") -> float:
    """Gain at which a simulation of the loop in fixed steps begins to grow.

    Parameters
    ----------
    step : float
        s.
    solver : str
        As in `simulate_fixed_step`.

    Returns
    -------
    float

    Examples
    --------
    >>> from deadtime import paper
    >>> round(paper.coarse_limit(0.001), 2), round(paper.coarse_limit(0.08), 2)
    (15.71, 18.55)
    """
    low, high = 10.0, 30.0
    while high - low > WIDTH * high:
        middle = 0.5 * (low + high)
        if _grows(middle, step, solver):
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


def _grows(gain: float, step: float, solver: str) -> bool:
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=gain), delay=DELAY, delay_path="measurement")
    try:
        run = dtm.simulate_fixed_step(loop, 120.0, step=step, solver=solver)
    except ValueError:  # beyond 1e150
        return True
    third, fourth = np.array_split(np.abs(run.outputs - 1.0), 4)[2:]
    return bool(fourth.max() > max(third.max(), DECAYED))


def figure3() -> Figure3:
    """Reproduce Figure 3.

    Returns
    -------
    Figure3

    Examples
    --------
    >>> from deadtime import paper
    >>> found = paper.figure3()
    >>> round(found.limit, 3), round(found.held_limit, 2)
    (15.708, 12.46)
    """
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.0), delay=DELAY)
    time = np.linspace(0.0, 6.0, 1801)
    limit = loop.stable_range("Kp")[1]
    limits = {step: coarse_limit(step) for step in STEPS}
    fits = [step for step, gain in limits.items() if 18.0 < gain <= 19.0]
    gains = np.append(np.arange(1.0, 20.0, 0.25), 19.0).tolist()
    return Figure3(
        responses={gain: loop.replace(Kp=gain).simulate(time) for gain in (15.0, 16.0, 18.0, 19.0)},
        rightmost={gain: complex(dtm.dde_roots(0.0, -gain, DELAY)) for gain in gains},
        limit=limit,
        held_limit=loop.replace(sample_time=HOLD).stable_range("Kp")[1],
        coarse_limits=limits,
        comparisons=(
            Comparison.of_limits(
                "Sec 2.1",
                "critical K at Td=0.1: roots",
                "16 (text), 15 (Fig.3 caption)",
                (15.0, 16.0),
                limit,
                "K Td = π/2",
                note="text and caption disagree, and the limit is between their values",
            ),
            Comparison.of_limits(
                "Fig 3 left",
                "critical K at Td=0.1: simulation",
                "19 (18 stable)",
                (18.0, 19.0),
                limit,
                "exact",
                note="fixed-step simulations have this limit only with coarse steps, such as "
                f"{', '.join(f'{1e3 * step:g}' for step in fits)} ms",
                **{f"coarse_{1e3 * step:g}_ms": gain for step, gain in limits.items()},
            ),
        ),
    )
