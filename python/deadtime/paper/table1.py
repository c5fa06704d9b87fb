"""Table 1: the integrator over the Internet, its overshoots and the delays from them.

Measured overshoots Mp of the loop z' = K (r - z) with a network between two computers; each
gives a damping ratio (eq. 5), a delay (eqs. 3 and 6) and the dominant pair of roots.
"""

from __future__ import annotations

from dataclasses import dataclass

import deadtime as dtm
from deadtime.paper.comparison import Comparison, printed_digits
from deadtime.paper.inversion import (
    damping_of,
    delay_by_dominant_root,
    delay_by_simulation,
    overshoot,
)
from deadtime.paper.part import Grid, Part

#: Gain: overshoot (%), damping ratio, delay (s), root, as printed.
PRINTED = {
    5: ("1.7", "0.7898", "0.09", ("-9.2", "7.2")),
    6: ("7", "0.6454", "0.09", ("-8.1", "9.6")),
    7: ("22", "0.4315", "0.104", ("-5.2", "10.8")),
    8: ("31.5", "0.3431", "0.104", ("-4.4", "11.8")),
    9: ("46", "0.2373", "0.11", ("-3.0", "12.1")),
    10: ("75", "0.0902", "0.13", ("-1.0", "11.4")),
}

#: Gain to measured overshoot in percent.
PRINTED_OVERSHOOTS = {gain: float(row[0]) for gain, row in PRINTED.items()}

#: Smallest overshoot that is visible in a plot, percent.
UNSEEN = 0.05


@dataclass(frozen=True)
class Table1Row:
    """Results from one measured overshoot.

    Attributes
    ----------
    gain : float
        K, 1/s.
    overshoot : float
        Measured overshoot, percent.
    damping : float
        Damping ratio by eq. 5.
    delay : float
        By the dominant root, s.
    exact_delay : float
        By the exact step response, s.
    taken_delay : float
        The delay that the paper uses further on: as printed, or in whole milliseconds where one
        digit is printed, s.
    root : complex
        Dominant root at `taken_delay`, 1/s.
    root_damping : float
        Damping ratio of that root.
    """

    gain: float
    overshoot: float
    damping: float
    delay: float
    exact_delay: float
    taken_delay: float
    root: complex
    root_damping: float


@dataclass(frozen=True)
class Table1(Part):
    """Table 1, reproduced.

    Attributes
    ----------
    rows : tuple of Table1Row
        One for each gain from 5 to 10.
    comparisons : tuple of Comparison
        The printed numbers beside ours.
    """

    rows: tuple[Table1Row, ...]

    def grids(self) -> tuple[Grid, ...]:
        """The delays by the dominant root and by the exact step response."""
        return (
            Grid(
                "Delay from the measured overshoot",
                ("K", "Mp", "dominant root", "exact", "too long by"),
                tuple(
                    (
                        f"{row.gain:g}",
                        f"{row.overshoot:g} %",
                        f"{1e3 * row.delay:.2f} ms",
                        f"{1e3 * row.exact_delay:.2f} ms",
                        f"{1e3 * (row.delay - row.exact_delay):.2f} ms",
                    )
                    for row in self.rows
                ),
            ),
        )

    def findings(self) -> tuple[str, ...]:
        """What the table shows."""
        exact = [row.exact_delay for row in self.rows]
        return (
            "The column of damping ratios does not follow from equation (5) and the printed "
            "overshoots. It contains the damping ratio of the dominant root at the delay that "
            "the paper uses further on.",
            f"By the exact step response the delays are {1e3 * min(exact):.1f} to "
            f"{1e3 * max(exact):.1f} ms. So the dominant root does not cause their increase "
            "with K (see Figure 2).",
        )


def table1() -> Table1:
    """Reproduce Table 1.

    Returns
    -------
    Table1

    Examples
    --------
    >>> from deadtime import paper
    >>> for row in paper.table1().rows[:2]:
    ...     print(f"{row.gain:g} {row.root_damping:.4f} {row.delay:.4f} {row.exact_delay:.4f}")
    5 0.7898 0.0918 0.0915
    6 0.6454 0.0909 0.0904
    """
    rows = tuple(_row(gain, percent) for gain, percent in PRINTED_OVERSHOOTS.items())
    compared = [_without_overshoot()]
    for row in rows:
        compared += _compared(row)
    compared.append(
        Comparison.of_statement(
            "Sec 2.1",
            "smallest K with overshoot",
            "> 5 (text)",
            holds=PRINTED_OVERSHOOTS[5] <= 0.0,
            shown=f"Table 1 lists {PRINTED[5][0]} % at K = 5",
            model="the paper's own table",
            note="text and table disagree",
        )
    )
    return Table1(rows, comparisons=tuple(compared))


def _row(gain: int, percent: float) -> Table1Row:
    part = percent / 100.0
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=float(gain)))
    delay = delay_by_dominant_root(gain, part)
    printed = PRINTED[gain][2]
    taken = float(printed) if printed_digits(printed) > 1 else round(delay, 3)
    root = complex(dtm.dde_roots(0.0, -gain, taken))
    return Table1Row(
        gain=gain,
        overshoot=percent,
        damping=dtm.damping_ratio(part),
        delay=delay,
        exact_delay=delay_by_simulation(loop, part),
        taken_delay=taken,
        root=root,
        root_damping=damping_of(root),
    )


def _without_overshoot() -> Comparison:
    """K from 1 to 4 at the delay that the table gives for K = 5."""
    delay = float(PRINTED[5][2])
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=4.0), delay=delay)
    largest = max(overshoot(loop.replace(Kp=float(gain))) for gain in range(1, 5))
    return Comparison.of_statement(
        "Table 1",
        "K=1..4 no overshoot",
        "none",
        holds=largest < UNSEEN,
        shown=f"at most {largest:.2f} %",
        model=f"exact, Td = {delay:g} s",
        note="an overshoot begins at K Td = 1/e, and is first visible (0.05 %) near K Td = 0.4",
        computed=largest,
    )


def _compared(row: Table1Row) -> list[Comparison]:
    measured, damping, delay, root = PRINTED[int(row.gain)]
    name = f"K={row.gain:g}"
    at = f"Td = {row.taken_delay:g} s"
    printed_damping = damping_of(complex(*map(float, root)))
    return [
        Comparison.of_measurement("Table 1", f"{name} Mp (%)", measured, None, "measured"),
        Comparison.of_number(
            "Table 1",
            f"{name} zeta",
            damping,
            row.root_damping,
            f"dominant root at {at}",
            note=f"equation (5) gives {row.damping:.4f} for the printed overshoot",
        ),
        Comparison.of_number(
            "Table 1",
            f"{name} Td (s)",
            delay,
            row.delay,
            "dominant root, eqs. 3, 5, 6",
            note=f"exact step response gives {row.exact_delay:.5f} s",
            exact=row.exact_delay,
        ),
        Comparison.of_root(
            "Table 1",
            f"{name} roots",
            root,
            row.root,
            f"W0 at {at}",
            note=f"the printed pair of roots has a damping ratio of {printed_damping:.4f}",
        ),
    ]
