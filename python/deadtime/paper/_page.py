"""The page of the reproduced paper: every printed number beside the computed one, and figures."""

from __future__ import annotations

from pathlib import Path

from deadtime._base.drawing import Figure
from deadtime._base.page import page, write_page
from deadtime.loops import PV, ControlLoop, Integrator
from deadtime.paper.comparison import Comparison, Verdict
from deadtime.paper.reproduction import TITLES, Reproduction

HEADS = ("where", "what", "printed", "ours", "verdict", "why, and with which model")

#: Captions of the figures.
CAPTIONS = {
    "table1": "The delays that the measured overshoots give: printed, by the dominant root, and by "
    "the exact step response.",
    "figure2": "Left: step responses of the loop. Middle: period and first peak with a hold or a "
    "lag, divided by those of a delay alone with the same overshoot; the six rows of Table 1. "
    "Right: how far one loop for all gains misses the overshoots of Table 1.",
    "figure3": "Left: responses on both sides of the limit. Middle: the rightmost root. Right: "
    "where a simulation in fixed steps sees the limit.",
    "table2": "The overshoot of the altitude loop over its delay.",
    "figure6": "The responses of Table 2, and their peaks with the samples of the coarse model.",
    "figure7": "Left: the loop with the delay that 2.3 % gives. Right: the delay that each "
    "flight gives, in three ways.",
    "gap": "From the delay by the dominant root to that by simulation.",
    "figure8": "Responses at Kp = 4 and 5, without the limit of the speed.",
    "figure9": "Roots of ten branches of W at Kp = 4 and 5.",
    "figure10": "The rightmost root over the velocity gain, with an ideal derivative and with the "
    "filter of the flights.",
    "figure11": "Left: responses of the model of the flights. Right: where they enter the band of "
    "2 % for good.",
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
        title="A paper on delays in quadrotor control, reproduced",
        verdict=found.summary(),
        titles=TITLES,
        captions=CAPTIONS,
        parts=parts,
        figures=found.figures() if figures is None else figures,
        heads=HEADS,
        rows={name: list(map(_row, part.comparisons)) for name, part in parts.items()},
        kinds={
            name: [CLASSES[one.verdict] for one in part.comparisons] for name, part in parts.items()
        },
        explorer=LOOP.explore(RANGES),
    )


def _row(one: Comparison) -> tuple[str, ...]:
    """A row of the table."""
    why = "; ".join(words for words in (one.model, one.note) if words)
    return (one.where, one.quantity, one.printed, one.shown, one.outcome, why)
