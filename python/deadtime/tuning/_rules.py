"""Gains by rules of thumb beside those of a loop or a design, with what each gives."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from deadtime._base.frozen import ReadOnlyArrays
from deadtime.loops import PI, Controller, ControlLoop
from deadtime.tuning._native import half_rule, tuning_rules
from deadtime.tuning._problem import controller_template

#: Where each rule comes from.
SOURCES = {
    "SIMC": "Skogestad 2003, equations 23 to 25 with tau_c = theta, by the half rule (10, 11)",
    "AMIGO": "Astrom and Hagglund 2004",
    "lambda": (
        "Astrom and Hagglund 2006, chapter 6; closed-loop time constant max(lag, 3 dead times)"
    ),
    "Ziegler-Nichols step": "Ziegler and Nichols 1942; Ti of PI is 3 L, not L/0.3, as in textbooks",
    "Ziegler-Nichols frequency": "Ziegler and Nichols 1942",
}


class RuleFigures(NamedTuple):
    """Gains by one rule, and what they give with the limit left out."""

    rule: str
    """``"given"`` or ``"design"`` for the gains of the loop itself."""
    gains: dict[str, float]
    """Empty where the rule does not apply to the plant."""
    max_sensitivity: float
    """Ms; NaN where the loop is not stable with these gains."""
    load_iae: float
    """Integral of the modulus of the output after a unit load at the plant's input."""
    settling_time: float
    """2 % settling time of a step of the reference, s."""
    overshoot: float
    """Its overshoot, %."""


@dataclass(frozen=True, eq=False, repr=False)
class RuleTable(ReadOnlyArrays):
    """Gains and figures by several rules; made by `rules` and `Design.compared`.

    Attributes
    ----------
    rows : tuple of RuleFigures
        The gains of the loop itself first.
    reduced : dict of str to float or None
        ``gain``, ``lag``, ``second_lag`` and ``dead_time`` (s) of the plant by the half rule, on
        which SIMC stands; a ``lag`` of inf is an integrator with the slope ``gain``. None for a
        plant with unstable or badly damped poles, two integrators or no dead time.
    """

    rows: tuple[RuleFigures, ...]
    reduced: dict[str, float] | None

    def __iter__(self) -> Iterator[RuleFigures]:
        return iter(self.rows)

    def __getitem__(self, rule: str) -> RuleFigures:
        for row in self.rows:
            if row.rule == rule:
                return row
        known = ", ".join(row.rule for row in self.rows)
        raise KeyError(f"the rule {rule!r} does not exist. Here the rules are {known}")

    def __repr__(self) -> str:
        names = list(self.rows[0].gains)
        head = ("rule", *names, "Ms", "load IAE", "settling s", "overshoot %")
        lines = [head, *(_line(row, names) for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return "\n".join(
            "  ".join(
                cell.ljust(width) if place == 0 else cell.rjust(width)
                for place, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        )

    def _repr_markdown_(self) -> str:
        names = list(self.rows[0].gains)
        head = ("rule", *names, "Ms", "load IAE", "settling, s", "overshoot, %")
        lines = [head, ("---",) * len(head), *(_line(row, names) for row in self.rows)]
        return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def rules(loop: object, *, controller: type[Controller] | Controller | None = None) -> RuleTable:
    """Gains of a loop beside those of SIMC, AMIGO, lambda tuning and Ziegler and Nichols.

    Parameters
    ----------
    loop : ControlLoop or a plant
        With its delay. Around a plant the gains are those of SIMC to begin with.
    controller : Controller or class of one, optional
        `PI` or `PID`, in place of that of the loop; PI around a plant.

    Returns
    -------
    RuleTable
        Every rule on the same loop: gains, Ms, load response, settling time and overshoot. Rules
        are for PI and PID; other controllers have one row.

    Raises
    ------
    ValueError
        If the delay is not known, or the plant has delays inside.

    Notes
    -----
    SIMC: Skogestad 2003, J. Process Control 13, equations 23 to 25 with tau_c = theta, of the plant
    by the half rule (equations 10 and 11; zeros by T1 to T3). AMIGO: Astrom and Hagglund 2004, J.
    Process Control 14, 635-650, of lag and dead time by the steepest tangent of the step response
    and the time to 63 %. Lambda: Astrom and Hagglund 2006, Advanced PID Control, chapter 6, for PI,
    with a closed loop as slow as the plant or three dead times. Ziegler and Nichols 1942, Trans.
    ASME 64, by step (Ti of PI is 3 L for L/0.3, as in textbooks) and by frequency response. Half a
    sample counts as dead time.

    Examples
    --------
    >>> import deadtime as dtm
    >>> process = dtm.ControlLoop(dtm.FirstOrder(2.0, 10.0), dtm.PI(1.0, 0.1), delay=2.0)
    >>> table = dtm.tuning.rules(process)
    >>> table["SIMC"].gains
    {'Kp': 1.25, 'Ki': 0.125}
    >>> round(table["SIMC"].max_sensitivity, 3)
    1.59
    """
    if not isinstance(loop, ControlLoop):
        loop = ControlLoop(loop, controller_template(PI if controller is None else controller))
    elif controller is not None:
        loop = loop.replace(controller=controller_template(controller))
    return compared(loop, "given")


def compared(loop: ControlLoop, name: str) -> RuleTable:
    """The table of a loop, whose own gains stand under a name."""
    _ = loop.specification.known_delay
    kernel, names = loop.specification.kernel, list(loop.controller.gains)
    rows = []
    for place, (rule, gains, *figures) in enumerate(tuning_rules(kernel)):
        known = {} if gains is None else dict(zip(names, gains, strict=True))
        rows.append(RuleFigures(rule if place else name, known, *figures))
    reduced = half_rule(kernel, "Kd" in names)
    parts = ("gain", "lag", "second_lag", "dead_time")
    return RuleTable(
        tuple(rows), None if reduced is None else dict(zip(parts, reduced, strict=True))
    )


def _line(row: RuleFigures, names: Sequence[str]) -> tuple[str, ...]:
    figures = (row.max_sensitivity, row.load_iae, row.settling_time, row.overshoot)
    cells = [*(row.gains.get(name, math.nan) for name in names), *figures]
    return (row.rule, *("-" if math.isnan(cell) else f"{cell:.4g}" for cell in cells))
