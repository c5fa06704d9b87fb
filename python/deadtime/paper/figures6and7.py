"""Figures 6 and 7: the altitude under proportional control, in simulation and flight.

Figure 6 shows the simulations of Table 2. From Figure 7, the flights, the printed
overshoots are used: each is converted to a delay in three ways.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deadtime.paper.comparison import Comparison
from deadtime.paper.inversion import delay_by_dominant_root, delay_by_simulation
from deadtime.paper.part import Grid, Part
from deadtime.paper.table2 import PRINTED, SAMPLE_TIME, altitude_loop, simulink
from deadtime.systems import Response

#: Delay that the paper uses further on, s.
DELAY = 0.36

#: Overshoots of the five flights as printed, percent.
FLIGHTS = ("2.3", "2.3", "2.29", "2.27", "0.6")


@dataclass(frozen=True, eq=False)
class Figure6(Part):
    """Figure 6, reproduced.

    Attributes
    ----------
    exact, coarse : dict of float to Response
        Responses over the delay in samples: of the loop, and of the coarse model.
    comparisons : tuple of Comparison
        The printed numbers beside ours.
    """

    exact: dict[float, Response]
    coarse: dict[float, Response]

    def findings(self) -> tuple[str, ...]:
        """What the figure shows."""
        return (
            "The responses of Table 2. Three of the seven delays differ by less than 0.13 ms. "
            "Neither the figure nor a recording with a row every 65 ms can show this "
            "difference.",
        )


def figure6() -> Figure6:
    """Reproduce Figure 6.

    Returns
    -------
    Figure6

    Examples
    --------
    >>> from deadtime import paper
    >>> sorted(paper.figure6().exact)[:3]
    [4.0, 5.0, 5.6]
    """
    time = np.linspace(0.0, 8.0, 801)
    samples = [float(row[0]) for row in PRINTED]
    onset = 1.0 / (math.e * DELAY)
    return Figure6(
        exact={n: altitude_loop(n * SAMPLE_TIME).simulate(time) for n in samples},
        coarse={n: simulink(n * SAMPLE_TIME) for n in samples},
        comparisons=(
            Comparison.of_number(
                "Sec 4.1",
                "overshoot appears for Kp >",
                "1.0",
                onset,
                "1/(e Td), Td = 0.36 s",
            ),
        ),
    )


@dataclass(frozen=True)
class Flight:
    """The delay from the overshoot of a flight, in s.

    Attributes
    ----------
    overshoot : float
        As printed, percent.
    dominant : float
        By the dominant root.
    linear, saturated : float
        By exact simulation, without and with the limit of the speed.
    """

    overshoot: float
    dominant: float
    linear: float
    saturated: float


@dataclass(frozen=True, eq=False)
class Figure7(Part):
    """Figure 7: the delays from the measured overshoots.

    Attributes
    ----------
    flights : tuple of Flight
        One for each flight.
    response : Response
        The loop with the delay that 2.3 % gives, its limit included.
    comparisons : tuple of Comparison
        The printed overshoots and the delays they give.
    """

    flights: tuple[Flight, ...]
    response: Response

    def grids(self) -> tuple[Grid, ...]:
        """Delay of each flight, in three ways."""
        return (
            Grid(
                "Delay from the overshoot of each flight",
                ("overshoot", "dominant root", "exact, no limit", "exact, limit 1 m/s"),
                tuple(
                    (
                        f"{flight.overshoot:g} %",
                        f"{flight.dominant:.4f} s",
                        f"{flight.linear:.4f} s",
                        f"{flight.saturated:.4f} s",
                    )
                    for flight in self.flights
                ),
            ),
        )

    def findings(self) -> tuple[str, ...]:
        """What the flights show."""
        delays = [flight.saturated for flight in self.flights]
        spread = 100.0 * (max(delays) - min(delays)) / max(delays)
        four = 100.0 * (max(delays[:4]) - min(delays[:4])) / max(delays[:4])
        return (
            f"The delays from four flights agree within {four:.2g} %. The fifth flight, with an "
            f"overshoot of {self.flights[-1].overshoot:g} %, is left out without a reason. With "
            f"this flight, the delays spread over {spread:.0f} %.",
        )


def figure7() -> Figure7:
    """Convert the overshoots of Figure 7 to delays.

    Returns
    -------
    Figure7

    Examples
    --------
    >>> from deadtime import paper
    >>> last = paper.figure7().flights[-1]
    >>> print(f"{last.overshoot:g} % {last.dominant:.4f} {last.linear:.4f} {last.saturated:.4f}")
    0.6 % 0.3277 0.3272 0.3318
    """
    loop = altitude_loop(DELAY)
    gain = loop.parameters["Kp"]
    flights, compared = [], []
    for printed in FLIGHTS:
        part = float(printed) / 100.0
        flight = Flight(
            overshoot=float(printed),
            dominant=delay_by_dominant_root(gain, part),
            linear=delay_by_simulation(loop.replace(limit=None), part),
            saturated=delay_by_simulation(loop, part),
        )
        flights.append(flight)
        compared.append(
            Comparison.of_measurement(
                "Fig 7",
                f"flight Mo {printed} %",
                printed,
                None,
                "delay from the overshoot: by the dominant root, exact, exact with the limit",
                shown=f"Td = {flight.dominant:.4f}, {flight.linear:.4f}, {flight.saturated:.4f} s",
                lambert=flight.dominant,
                exact_linear=flight.linear,
                exact_saturated=flight.saturated,
            )
        )
    response = loop.replace(delay=flights[0].saturated).simulate(np.linspace(0.0, 8.0, 801))
    return Figure7(tuple(flights), response, comparisons=tuple(compared))
