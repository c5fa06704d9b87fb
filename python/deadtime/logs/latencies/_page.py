"""The parts of the page on a log's latencies: rows, budget and fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from deadtime._base.verdicts import NOT_CLAIMED
from deadtime.logs.latencies._budget import Stage
from deadtime.logs.latencies._moves import Moves
from deadtime.logs.latencies._plots import plot_fit, plot_moves
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.logs.latencies._table import cells_of
from deadtime.logs.latencies._words import plain_rows, said_of


def budget_of(stages: Mapping[str, Sequence[Stage]]) -> list[tuple[str, ...]]:
    """The stages of each loop that has more than one."""
    rows: list[tuple[str, ...]] = []
    for name, some in stages.items():
        for stage in some if len(some) > 1 else ():
            shown = f"— {stage.name}" if stage.part else stage.name
            rows.append((name, shown, stage.shown(), stage.source))
    return rows


def fit_of(
    loop: LoopLatency, moves: Moves | None = None, fitted: Moves | None = None
) -> dict[str, object]:
    """A fit with its number, its pictures and what it costs.

    `moves` are those of the setpoint of the loop, `fitted` the same with the response of the fit.
    """
    start, stop = loop.windows[0]
    number = len(loop.windows)
    more = f", the best of {number} windows that were fitted together" if number > 1 else ""
    _, command, time, ends, verdict, seen, *_ = cells_of(loop)
    held = f"95 %: {ends}" if ends else NOT_CLAIMED
    return {
        "heading": _capital(loop.name),
        "number": time,
        "beside": f"{verdict}; {held}; from the {command}, seen in {seen}",
        "sentences": [sentence(words) for words in said_of(loop)],
        "plain": plain_rows(loop),
        "moves": None if moves is None else moves_of_page(moves, fitted),
        "figure": plot_fit(loop),
        "caption": f"The window from {start:.1f} to {stop:.1f} s{more}.",
    }


def moves_of_page(moves: Moves, fitted: Moves | None = None) -> dict[str, object]:
    """The picture of all moves, and what it shows in words; no picture without a move."""
    if not moves.count:
        return {"figure": None, "caption": sentence(moves.headline())}
    if fitted is None or fitted.reason:
        figure, of_fit = plot_moves(moves), ""
    else:
        figure = plot_moves(moves, fitted.median, fitted.response)
        of_fit = f". For the fit, at the same rows, it is {moves.shown(fitted.median)}"
    caption = sentence(f"{moves.headline()}{of_fit}")
    drawn = (
        "Thin lines: the response to each move, divided by the change of the setpoint. "
        "Band: quartiles."
    )
    return {"figure": figure, "caption": f"{caption} {drawn}"}


def sentence(words: str) -> str:
    """Words as a sentence."""
    return f"{_capital(words)}."


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
