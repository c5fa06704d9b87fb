"""Table 2: the overshoot of the simulated altitude loop over the delay in samples.

z' = w, w the limited command of u = Kp (r - z) with Kp = 1.31, Td = N Ts later, Ts = 0.065 s; the
vertical speed is limited to 1 m/s. The printed numbers are from a block diagram in coarse fixed
steps: `simulink` is a model of it, selected among many. The exact simulation shows the loop itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import deadtime as dtm
from deadtime.paper.comparison import Comparison
from deadtime.paper.inversion import overshoot
from deadtime.paper.part import Grid, Part
from deadtime.systems import Response

#: Sample time of the loop over the wireless network, s.
SAMPLE_TIME = 0.065

#: Delay in samples, overshoot (%), delay (s), as printed.
PRINTED = (
    ("4.0", "0.000", "0.26"),
    ("5.0", "0.419", "0.325"),
    ("5.6", "2.067", "0.364"),
    ("5.664", "2.298", "0.3682"),
    ("5.6646", "2.300", "0.3682"),
    ("5.666", "2.305", "0.3683"),
    ("5.7", "2.429", "0.3705"),
)

#: Time of the step in the coarse model, s, which is not one of its time steps.
STEP_TIME = 0.5


def altitude_loop(delay: float, Kp: float = 1.31, limit: float | None = 1.0) -> dtm.ControlLoop:
    """The altitude loop of the paper under proportional control, continuous.

    Parameters
    ----------
    delay : float
        s.
    Kp : float
        Gain, 1/s.
    limit : float, optional
        Of the vertical speed, m/s; None for none.

    Returns
    -------
    ControlLoop
        With its delay in the measurement, where the paper's block diagram has it.
    """
    return dtm.ControlLoop(
        dtm.Integrator(), dtm.P(Kp=Kp), delay=delay, limit=limit, delay_path="measurement"
    )


def simulink(delay: float, end: float = 10.0) -> Response:
    """Run the coarse block diagram that gives the printed digits of Table 2.

    Fixed steps of one sample (0.065 s) of the third-order formula, a transport delay in the
    measurement whose buffer is read by straight lines, vertical speed limited to 1 m/s, and the
    reference stepping at 0.5 s, between two steps.

    Parameters
    ----------
    delay : float
        s.
    end : float
        Time of the last step, s.

    Returns
    -------
    Response

    Notes
    -----
    Selected because it fits, from about 1500 variants of step, formula, delay path and phase. The
    limit of the speed is certain (no variant without it is within 0.7 points), steps near 0.065 s
    are very likely; formula and phase are not identified: the paper names ode8.

    Examples
    --------
    >>> from deadtime import paper
    >>> response = paper.simulink(5.6646 * 0.065)
    >>> print(f"{100 * (response.outputs.max() - 1):.3f}")
    2.300
    """
    return dtm.simulate_fixed_step(
        altitude_loop(delay),
        end,
        [1.0],
        reference_time=[STEP_TIME],
        reference_before=0.0,
        step=SAMPLE_TIME,
        solver="ode3",
    )


@dataclass(frozen=True)
class Table2Row:
    """One delay of Table 2; overshoots in percent.

    Attributes
    ----------
    samples : float
        N, the delay in samples.
    delay : float
        N Ts, s.
    printed : float
        Overshoot as printed.
    coarse : float
        By the coarse model `simulink`.
    exact : float
        By exact simulation.
    unlimited : float
        By exact simulation, the vertical speed not limited.
    """

    samples: float
    delay: float
    printed: float
    coarse: float
    exact: float
    unlimited: float


@dataclass(frozen=True)
class Table2(Part):
    """Table 2, reproduced.

    Attributes
    ----------
    rows : tuple of Table2Row
        One for each delay.
    comparisons : tuple of Comparison
        The printed numbers beside those of the coarse model.
    """

    rows: tuple[Table2Row, ...]

    def grids(self) -> tuple[Grid, ...]:
        """Overshoots: printed, coarse, exact, and without the limit."""
        return (
            Grid(
                "Overshoot (%) for each delay",
                ("N", "Td", "printed", "coarse steps", "exact", "exact, no limit"),
                tuple(
                    (
                        f"{row.samples:g}",
                        f"{row.delay:.4f} s",
                        f"{row.printed:.3f}",
                        f"{row.coarse:.3f}",
                        f"{row.exact:.3f}",
                        f"{row.unlimited:.3f}",
                    )
                    for row in self.rows
                ),
            ),
        )

    def findings(self) -> tuple[str, ...]:
        """What the table shows."""
        off = max(abs(row.printed - row.exact) for row in self.rows)
        unlimited = max(abs(row.printed - row.unlimited) for row in self.rows)
        return (
            "A simulation with coarse steps of one sample and a speed limit of 1 m/s gives "
            f"every printed digit. Its overshoots differ by up to {off:.3f} points from the "
            "exact response.",
            f"Without the limit the overshoots differ by up to {unlimited:.3f} points, so the "
            "limit was active. The order of the solver and the phase of the step cannot be "
            "identified.",
        )


def table2() -> Table2:
    """Reproduce Table 2.

    Returns
    -------
    Table2

    Examples
    --------
    >>> from deadtime import paper
    >>> print(*(f"{row.exact:.3f}" for row in paper.table2().rows))
    0.000 0.398 2.038 2.272 2.274 2.280 2.408
    """
    rows, compared = [], []
    for samples, percent, printed_delay in PRINTED:
        delay = float(samples) * SAMPLE_TIME
        row = Table2Row(
            samples=float(samples),
            delay=delay,
            printed=float(percent),
            coarse=100.0 * max(0.0, float(simulink(delay).outputs.max()) - 1.0),
            exact=overshoot(altitude_loop(delay)),
            unlimited=overshoot(altitude_loop(delay, limit=None)),
        )
        rows.append(row)
        compared += [
            Comparison.of_number(
                "Table 2",
                f"N={samples} Mo (%)",
                percent,
                row.coarse,
                "coarse fixed steps (0.065 s, ode3), limit 1 m/s",
                note=f"exact: {row.exact:.3f} %, exact without the limit: {row.unlimited:.3f} %",
                exact=row.exact,
                unlimited=row.unlimited,
            ),
            Comparison.of_number(
                "Table 2", f"N={samples} Td=N Ts", printed_delay, delay, "N × 0.065 s"
            ),
        ]
    return Table2(tuple(rows), comparisons=tuple(compared))
