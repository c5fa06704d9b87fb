"""The page of the reproduced paper: every printed number beside the computed one, and figures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from deadtime._base.page import escaped, page, picture, table, table_row, write_page
from deadtime.loops import PV, ControlLoop, Integrator
from deadtime.paper import TITLES, Comparison, Grid, Part, Reproduction, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = """
body { max-width: 66rem; }
td { vertical-align: top; }
table.numbers td:nth-child(2), table.numbers th:nth-child(2) { text-align: left; }
table.numbers td:last-child, table.numbers th:last-child { text-align: left; font-size: .85rem; }
tr.good td:nth-child(5) { color: #1d7a3e; }
tr.partly td:nth-child(5) { color: #9a6700; }
tr.bad td:nth-child(5) { color: #b3261e; font-weight: 600; }
tr.measured td { color: #666; }
nav a { margin-right: .8rem; }
"""

HEADS = ("where", "what", "printed", "ours", "verdict", "why, and with which model")

#: Captions of the figures.
CAPTIONS = {
    "table1": "The delays that the measured overshoots give: printed, by the dominant root, and by "
    "the exact step response.",
    "figure2": "Left: step responses of the loop. Middle: period and first peak with a hold or a "
    "lag over those of a delay alone that overshoots by as much, for the six rows of Table 1. "
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
    drawn = found.figures() if figures is None else figures
    links = " ".join(
        f'<a href="#{name}">{escaped(TITLES[name].split(":")[0])}</a>' for name in found.parts
    )
    body = [
        "<p>S. K. Armah and S. Yi, “Analysis of Time Delays in Quadrotor Systems and Design of "
        "Control”: every printed number beside the one computed with this package. The "
        "verdicts are computed from the digits.</p>",
        f'<p class="verdict">{escaped(found.summary())}</p>',
        f"<nav>{links}</nav>",
    ]
    for name, part in found.parts.items():
        body += _part(name, part, drawn.get(name))
    body += ["<h2>The loop of the paper, live</h2>", LOOP.explore(RANGES).frame]
    return page("A paper on delays in quadrotor control, reproduced", body, STYLE)


def _part(name: str, part: Part, figure: Figure | None) -> Iterator[str]:
    yield f'<section id="{name}"><h2>{escaped(TITLES[name])}</h2>'
    yield from (f"<p>{escaped(sentence)}</p>" for sentence in part.findings())
    if figure is not None:
        yield picture(f"{name}-drawing", figure, CAPTIONS[name])
    if part.comparisons:
        rows = [_compared(one) for one in part.comparisons]
        yield table(HEADS, rows).replace("<table>", '<table class="numbers">', 1)
    yield from (_grid(grid) for grid in part.grids())
    yield "</section>"


def _compared(one: Comparison) -> str:
    why = "; ".join(words for words in (one.model, one.note) if words)
    cells = (one.where, one.quantity, one.printed, one.shown, one.outcome, why)
    row = table_row(cells, "td", len(HEADS))
    return row.replace("<tr>", f'<tr class="{CLASSES[one.verdict]}">', 1)


def _grid(grid: Grid) -> str:
    width = len(grid.heads)
    return table(grid.heads, [table_row(row, "td", width) for row in grid.rows], grid.title)
