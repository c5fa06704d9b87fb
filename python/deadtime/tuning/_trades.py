"""What each demand on a design costs: the best gains without it, beside those with it."""

from __future__ import annotations

import math

from deadtime.tuning._demands import Demands
from deadtime.tuning._exchange import Found
from deadtime.tuning._result import LeastMargins, Trade, figure_in_words
from deadtime.tuning._search import Search

__all__ = ["trades"]

#: A margin so close to what was asked for holds the design back.
_ACTIVE = 1.0 + 1e-3

#: Up to so much beyond its demand a margin is tried without: the search may stop short of it.
_NEAR = 1.05

#: A loss so small, relatively, is none.
_NOTHING = 1e-3

_UNITS = {"gain": "", "phase": "°", "delay": " s"}


def trades(
    search: Search, demands: Demands, found: Found, margins: LeastMargins, value: float
) -> tuple[Trade, ...]:
    """The price of each margin, of all of them, and of the intervals."""
    objective, problem = search.objective, search.problem
    asked = demands.asked
    made = []

    def best_without(rest: Demands, scenarios: tuple[dict[str, float], ...]) -> float:
        gains = search.globally(scenarios, rest)
        return objective.value(problem, gains, scenarios)

    for name, least in asked.items():
        had = float(getattr(margins, name))
        active = had <= least * _ACTIVE
        what = f"{name} margin of at least {least:g}{_UNITS[name]}"
        without = value
        if had <= least * _NEAR:
            without = best_without(demands.without(name), found.scenarios)
            active = active or objective.lost(value, without) > _NOTHING
        if active:
            words = f"{what} holds the design back: {_price(search, value, without)}"
        else:
            words = f"{what} is met anyway: {had:.4g}{_UNITS[name]}"
        made.append(Trade(f"{name} margin", least, had, active, without, words))
    if sum(trade.active for trade in made) > 1:
        without = best_without(Demands(), found.scenarios)
        words = f"all margins together: {_price(search, value, without, 'them')}"
        made.append(Trade("all margins", math.nan, math.nan, True, without, words))
    if any(low < high for low, high in problem.intervals.values()):
        without = best_without(demands, (problem.middle,))
        lost = objective.lost(value, without)
        names = " and ".join(name for name, (low, high) in problem.intervals.items() if low < high)
        words = (
            f"not knowing the {names}: were it in the middle of its interval for certain, "
            f"{figure_in_words(objective.name, without)} could be had ({_part(lost)})"
        )
        made.append(Trade("interval", math.nan, math.nan, lost > _NOTHING, without, words))
    return tuple(made)


def _price(search: Search, value: float, without: float, what: str = "it") -> str:
    lost = search.objective.lost(value, without)
    return f"without {what} {figure_in_words(search.objective.name, without)} ({_part(lost)})"


def _part(lost: float) -> str:
    return f"{100.0 * lost:.2g} % lost" if lost > _NOTHING else "nothing lost"
