"""The page of a proposal."""

from __future__ import annotations

from collections.abc import Sequence

from deadtime._base.drawing import Figure
from deadtime._base.explorer import Explorer
from deadtime._base.page import page
from deadtime.estimation import PlantEstimate
from deadtime.loops import ControlLoop, explorer_of
from deadtime.tuning._rules import RuleFigures, RuleTable
from deadtime.tuning.forms import Settings

CAPTION = (
    "Predicted with the gains above. The band contains all plants that agree with the "
    "recording. On either side it is wider by twice the standard deviation of the residuals."
)

#: Heads of the table of rules.
HEADS = ("rule", "gains", "Ms", "load IAE", "settling, s", "overshoot, %")


def render(
    headline: str,
    fit: PlantEstimate,
    settings: Settings,
    expected: Sequence[str],
    figure: Figure,
    loop: ControlLoop,
    rules: RuleTable,
) -> str:
    """The page as text."""
    rounding = 100.0 * settings.rounding
    return page(
        "tuning/proposal/page.html",
        title=f"Gains from {fit.recording.source or 'a recording'}",
        described=fit.headline(),
        verdict=headline,
        lines=settings.lines,
        notes=[f"Rounding changes no gain by more than {rounding:.2g} %.", *settings.notes],
        source=settings.source,
        expected=expected,
        figure=figure,
        caption=CAPTION,
        heads=HEADS,
        rules=[_row(row) for row in rules if row.gains],
        explorer=_explored(fit, loop),
    )


def _row(row: RuleFigures) -> tuple[str, ...]:
    """One rule, its gains and figures."""
    gains = ", ".join(f"{name} = {gain:.4g}" for name, gain in row.gains.items())
    return (row.rule, gains, *(f"{number:.4g}" for number in row[2:]))


def _explored(fit: PlantEstimate, loop: ControlLoop) -> Explorer | None:
    """The explorer of the proposed loop; None where it has no such loop."""
    low, high = fit.ci(0.95, "delay")
    try:
        return explorer_of(loop.specification, interval=(low, high) if low < high else None)
    except ValueError:
        return None
