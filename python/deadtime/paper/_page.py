"""The page of the reproduced paper: every printed number beside the computed one, and figures."""

from __future__ import annotations

from pathlib import Path

from deadtime._base.drawing import Figure
from deadtime._base.page import page, write_page
from deadtime.loops import PV, ControlLoop, Integrator
from deadtime.paper.comparison import Comparison, Verdict
from deadtime.paper.reproduction import TITLES, Reproduction

HEADS = ("where", "what", "printed", "ours", "verdict", "reason and model")

#: Captions of the figures.
CAPTIONS = {
    "table1": "The delays that follow from the measured overshoots: as printed, by the "
    "dominant root, and by the exact step response.",
    "figure2": "Left: step responses of the loop. Middle: period and first peak with a hold or "
    "a lag, for the six rows of Table 1. Each is divided by its value for a delay "
    "alone with the same overshoot. Right: error of the overshoots of Table 1, if "
    "one loop has to give all six.",
    "figure3": "Left: responses on both sides of the stability limit. Middle: the rightmost "
    "root. Right: the stability limit in simulations with fixed steps.",
    "table2": "The overshoot of the altitude loop for each delay.",
    "figure6": "The responses of Table 2, and their peaks with the samples of the coarse model.",
    "figure7": "Left: the loop with the delay that gives an overshoot of 2.3 %. Right: the "
    "delay from each flight, by three methods.",
    "gap": "The contributions that lead from the delay by the dominant root to the delay by "
    "simulation.",
    "figure8": "Responses at Kp = 4 and 5, without the limit of the speed.",
    "figure9": "Roots from ten branches of the Lambert W function at Kp = 4 and 5.",
    "figure10": "The rightmost root for each velocity gain, with an ideal derivative and with "
    "the filter of the flights.",
    "figure11": "Left: responses of the model of the flights. Right: the time after which each "
    "response stays within 2 %.",
}

#: The loop with velocity feedback, and the gains that its map shows at first.
LOOP = ControlLoop(Integrator(), PV(Kp=2.0, Kv=0.3), delay=0.36, limit=1.0)
RANGES = {"Kp": (0.0, 6.0), "Kv": (-1.0, 1.0)}

#: Class of a row of the table.
CLASSES = {
    Verdict.EXACT: "good",
    Verdict.CONFIRMED: "good",
    Verdict.PARTLY: "partly",
    Verdict.DIFFERENT: "bad",
    Verdict.CONTRADICTED: "bad",
    Verdict.MEASURED: "measured",
}


def write_reproduction(
    found: Reproduction, path: Path, figures: dict[str, Figure] | None = None
) -> Path:
    """Write the page to `path` and return it; `figures` as `found.figures()` gives them."""
    return write_page(render_reproduction(found, figures), path)


def render_reproduction(found: Reproduction, figures: dict[str, Figure] | None = None) -> str:
    """The page as text."""
    parts = found.parts
    return page(
        "paper/page.html",
        title="The paper on delays in quadrotor control, reproduced",
        verdict=found.summary(),
        titles=TITLES,
        captions=CAPTIONS,
        parts=parts,
        figures=found.figures() if figures is None else figures,
        heads=HEADS,
        rows={name: list(map(_row, part.comparisons)) for name, part in parts.items()},
        kinds={
            name: [CLASSES[row.verdict] for row in part.comparisons] for name, part in parts.items()
        },
        explorer=LOOP.explore(RANGES),
    )


def _row(result: Comparison) -> tuple[str, ...]:
    """A row of the table."""
    why = "; ".join(words for words in (result.model, result.note) if words)
    return (result.where, result.quantity, result.printed, result.shown, result.outcome, why)
