"""One design: search, check, and say what the requirements cost.

What a requirement costs is told by the best gains without it, beside those with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from deadtime.tuning._demands import white_to
from deadtime.tuning._exchange import Found, Search, fine, margin_places, proved
from deadtime.tuning._margins import UNITS, RequiredMargins, exact_margins, least_margins
from deadtime.tuning._native import noise_gain
from deadtime.tuning._objectives import lost
from deadtime.tuning._problem import ObjectiveName, Problem
from deadtime.tuning._result import Design, LeastMargins, Trade, figure_in_words
from deadtime.tuning._settling import step_info
from deadtime.tuning._survey import surveyed

#: A margin at most this factor above its requirement limits the design.
_ACTIVE = 1.0 + 1e-3

#: Up to this factor above its requirement, a design without it is tried: the search may stop
#: short of it.
_NEAR = 1.05

#: Relative loss that counts as none.
_NOTHING = 1e-3


def made(
    problem: Problem,
    objective: ObjectiveName,
    required: RequiredMargins,
    shape: Sequence[int] | None,
) -> Design:
    """Find the gains of a problem."""
    survey = surveyed(problem, shape)
    search = Search(problem, objective, survey, required)
    found = search.best()
    judged = [*fine(problem), found.worst]
    each = problem.candidates(judged)
    value = search.proved(found)
    middle = problem.at(found.gains)
    places = [*margin_places(problem, found.gains), found.worst]
    exact = exact_margins(problem, found.gains, places)
    margins = LeastMargins(
        *least_margins(exact[:, :3]).tolist(), *exact[:, 3:].max(axis=0).tolist()
    )
    return Design(
        loop=middle,
        gains=middle.controller.gains,
        fixed=tuple(name for name in middle.controller.gains if name not in problem.free),
        abscissa=float(each.costs(found.gains[None, :], "abscissa", problem.threads).max()),
        damping=float(each.dominant(found.gains.tolist())[:, 0].min()),
        margins=margins,
        delays=problem.delays,
        gain=problem.intervals.get("gain"),
        objective=objective,
        value=value,
        step_info=step_info(middle, problem.amplitude),
        amplitude=problem.amplitude,
        worst=found.worst,
        checked=found.checked,
        proved=proved(problem, found.gains, required),
        region=problem.region,
        traded=_trades(search, found, margins, value),
        noise_gain=noise_gain(middle.specification.kernel, white_to(middle)),
        _problem=problem,
        _survey=survey,
    )


def _trades(search: Search, found: Found, margins: LeastMargins, value: float) -> tuple[Trade, ...]:
    """The price of each margin, of all of them, and of the intervals."""
    objective, problem, required = search.objective, search.problem, search.required
    made = []
    for name, least in required.named.items():
        achieved = float(getattr(margins, name))
        active = achieved <= least * _ACTIVE
        what = f"{name.replace('_', ' ')} of at least {least:g}{UNITS[name]}"
        without = value
        if achieved <= least * _NEAR:
            without = search.value_without(required.without(name), found.scenarios)
            active = active or lost(objective, value, without) > _NOTHING
        if active:
            words = f"{what} limits the design: {_price(search, value, without)}"
        else:
            words = f"{what} is met anyway: {achieved:.4g}{UNITS[name]}"
        made.append(Trade(name, least, achieved, active, without, words))
    if sum(trade.active for trade in made) > 1:
        without = search.value_without(RequiredMargins(), found.scenarios)
        words = f"all margins together: {_price(search, value, without, 'them')}"
        made.append(Trade("all_margins", math.nan, math.nan, True, without, words))
    if any(low < high for low, high in problem.intervals.values()):
        without = search.value_without(required)
        price = lost(objective, value, without)
        *others, last = (name for name, (low, high) in problem.intervals.items() if low < high)
        names = f"{', '.join(others)} and {last}" if others else last
        known = "in the middle of their intervals"
        if problem.region is not None:
            known = "exactly as estimated"
        words = (
            f"effect of the uncertainty of the {names}: without it (values {known}) "
            f"{figure_in_words(objective, without)} ({_part(price)})"
        )
        made.append(Trade("interval", math.nan, math.nan, price > _NOTHING, without, words))
    return tuple(made)


def _price(search: Search, value: float, without: float, what: str = "it") -> str:
    price = lost(search.objective, value, without)
    return f"without {what} {figure_in_words(search.objective, without)} ({_part(price)})"


def _part(lost: float) -> str:
    return f"cost {100.0 * lost:.2g} %" if lost > _NOTHING else "no cost"
