"""Figure 11 and section 4.4: the flights under proportional-plus-velocity control, and the filter.

The model of the flights has the measured delay, the filter of the velocity and the limit of the
vertical speed. Its settling time is sensitive: an oscillation that just reaches the band of 2 %
changes it by half a period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deadtime.loops import PAPER_FILTER
from deadtime.paper.comparison import Comparison
from deadtime.paper.figure10 import velocity_loop
from deadtime.paper.figures6and7 import DELAY
from deadtime.paper.part import Grid, Part
from deadtime.systems import Response

#: Velocity gain and settling time of the flight as printed, s.
PRINTED = {0.3: "1.86", 0.7: "2.47"}

#: Speed limit, m/s.
LIMIT = 1.0

#: Half widths of the settling band, in parts of the step: the usual one, and a little more.
BAND, WIDER = 0.02, 0.021

#: Printed cutoff of the filter, rad/s and Hz.
CUTOFF, CUTOFF_HZ = "5.68", "0.90"


@dataclass(frozen=True)
class SettlingTimes:
    """Settling of the model of a flight, in s.

    Attributes
    ----------
    gain : float
        Kv.
    overshoot : float
        Percent.
    from_step : float
        From the step of the reference, to 2 %.
    from_motion : float
        From when the vehicle begins to move, one delay later.
    wider : float
        From then, to 2.1 %.
    """

    gain: float
    overshoot: float
    from_step: float
    from_motion: float
    wider: float


@dataclass(frozen=True, eq=False)
class Figure11(Part):
    """Figure 11, from the model.

    Attributes
    ----------
    responses : dict of float to Response
        Of the model of the flights, over Kv.
    settling : tuple of SettlingTimes
        One for each flight.
    unlimited : Response
        At Kv = 0.3 without the limit: the paper's simulation.
    cutoffs : dict of str to float
        Possible definitions of the cutoff of the filter, rad/s.
    comparisons : tuple of Comparison
        The printed numbers beside ours.
    """

    responses: dict[float, Response]
    settling: tuple[SettlingTimes, ...]
    unlimited: Response
    cutoffs: dict[str, float]

    def grids(self) -> tuple[Grid, ...]:
        """Settling times of the model, and cutoffs of the filter."""
        return (
            Grid(
                "Settling time (s) of the model of the flights",
                ("Kv", "printed", "from the step", "from motion", "to 2.1 %"),
                tuple(
                    (
                        f"{settling.gain:g}",
                        PRINTED[settling.gain],
                        f"{settling.from_step:.3f}",
                        f"{settling.from_motion:.3f}",
                        f"{settling.wider:.3f}",
                    )
                    for settling in self.settling
                ),
            ),
            Grid(
                "Cutoff frequencies of the filter with poles at 38 rad/s; the paper prints "
                f"{CUTOFF} rad/s",
                ("where", "rad/s"),
                tuple((name, f"{value:.2f}") for name, value in self.cutoffs.items()),
            ),
        )

    def findings(self) -> tuple[str, ...]:
        """What the figure shows."""
        slow = self.settling[-1]
        return (
            "At Kv = 0.7 a peak of the response is just outside the 2 % band. The model "
            f"settles within 2 % after {slow.from_motion:.2f} s, and within 2.1 % after "
            f"{slow.wider:.2f} s. The {PRINTED[0.7]} s of the flight agree with the second time. A "
            "settling time that depends on such a small change is not meaningful.",
        )


def figure11() -> Figure11:
    """Simulate the flights of Figure 11.

    Returns
    -------
    Figure11

    Examples
    --------
    >>> from deadtime import paper
    >>> for settling in paper.figure11().settling:
    ...     print(f"{settling.gain:g} {settling.from_motion:.3f} {settling.wider:.3f}")
    0.3 1.739 1.719
    0.7 3.070 2.459
    """
    time = np.linspace(0.0, 12.0, 2401)
    responses = {gain: velocity_loop(gain, limit=LIMIT).simulate(time) for gain in PRINTED}
    unlimited = velocity_loop(0.3).simulate(time)
    settling = tuple(_settling(gain, response) for gain, response in responses.items())
    cutoffs = _cutoffs()
    comparisons = _compared(settling, unlimited, cutoffs)
    return Figure11(responses, settling, unlimited, cutoffs, comparisons=comparisons)


def _settling(gain: float, response: Response) -> SettlingTimes:
    info = response.info(settling=BAND)
    wider = response.info(settling=WIDER)["settling_time"]
    return SettlingTimes(
        gain=gain,
        overshoot=info["overshoot"],
        from_step=info["settling_time"],
        from_motion=info["settling_time"] - DELAY,
        wider=wider - DELAY,
    )


def _cutoffs() -> dict[str, float]:
    """Frequencies at which w^2 s/(s + w)^2, or a part of it, is down by 3 dB, in rad/s.

    Of the low pass w^2/(s + w)^2 below, of the high pass s^2/(s + w)^2 above, and of the band pass
    w s/(s + w)^2 at its lower edge.
    """
    corner = PAPER_FILTER.omega
    falls = math.sqrt(math.sqrt(2.0) - 1.0)
    return {
        "low pass": corner * falls,
        "high pass": corner / falls,
        "band pass, lower edge": corner * (math.sqrt(2.0) - 1.0),
    }


def _compared(
    settling: tuple[SettlingTimes, ...], unlimited: Response, cutoffs: dict[str, float]
) -> tuple[Comparison, ...]:
    info = unlimited.info(settling=BAND)
    damping, corner = PAPER_FILTER.damping, PAPER_FILTER.omega
    poles = np.roots([1.0, 2.0 * damping * corner, corner**2])
    nearest = min(cutoffs.values(), key=lambda value: abs(value - float(CUTOFF)))
    model = "Td = 0.36 s, filter, limit of 1 m/s, time from the start of the motion"
    return (
        Comparison.of_statement(
            "Sec 4.4",
            "Mo < 1 %, ts < 2 s at Kp=2, Kv=0.3",
            "<1 %, <2 s",
            holds=info["overshoot"] < 1.0 and info["settling_time"] < 2.0,
            shown=f"{info['overshoot']:.2f} %, {info['settling_time']:.3f} s",
            model="filter, no limit, exact",
            note=f"with the limit: {settling[0].overshoot:.2f} % overshoot, settled "
            f"{settling[0].from_step:.3f} s after the step and "
            f"{settling[0].from_motion:.3f} s after the start of the motion",
            overshoot=info["overshoot"],
            settling_time=info["settling_time"],
        ),
        Comparison.of_number(
            "Sec 4.4",
            "filter poles",
            "-38",
            float(poles.real.max()),
            "s² + 2·38 s + 38²",
            note="a double pole",
        ),
        Comparison.of_number(
            "Sec 4.4",
            "filter cutoff 5.68 rad/s = 0.90 Hz",
            CUTOFF_HZ,
            float(CUTOFF) / (2.0 * math.pi),
            "conversion of 5.68 rad/s to Hz",
        ),
        Comparison.of_number(
            "Sec 4.4",
            "filter cutoff from 38 rad/s",
            CUTOFF,
            nearest,
            "the nearest of three definitions of the cutoff",
            note="5.68 rad/s does not follow from poles at 38 rad/s, whose cutoffs are: "
            + ", ".join(f"{name} {value:.2f}" for name, value in cutoffs.items()),
        ),
        *(
            Comparison.of_measurement(
                "Fig 11",
                f"ts Kv={row.gain:g}",
                PRINTED[row.gain],
                row.from_motion,
                model,
                note=f"{row.from_step:.3f} s after the step; {row.wider:.3f} s to 2.1 % instead "
                "of 2 %",
                from_step=row.from_step,
                wider=row.wider,
            )
            for row in settling
        ),
    )
