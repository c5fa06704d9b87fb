"""One design from a problem, an objective and demands."""

from __future__ import annotations

from collections.abc import Sequence

from deadtime.tuning._demands import Demands, MarginEstimate, exact_margins
from deadtime.tuning._exchange import best_gains, least_margins
from deadtime.tuning._objectives import Objective, dominant_damping
from deadtime.tuning._problem import Problem
from deadtime.tuning._result import Design, LeastMargins
from deadtime.tuning._search import Search
from deadtime.tuning._step import step_info
from deadtime.tuning._survey import charts_at, surveyed
from deadtime.tuning._trades import trades
from deadtime.tuning._worst import fine, proved

__all__ = ["made"]


def made(
    problem: Problem, objective: Objective, demands: Demands, shape: Sequence[int] | None
) -> Design:
    """Search, check, and say what it cost."""
    search = Search(problem, objective, surveyed(problem, shape), MarginEstimate(problem))
    found = best_gains(search, demands)
    judged = [*fine(problem), found.worst]
    loops = [problem.at(found.gains, one) for one in judged]
    value = objective.proved(problem, found.gains, judged)
    loop = problem.at(found.gains)
    places = [*fine(problem, margins=True), found.worst]
    margins = LeastMargins(*least_margins(exact_margins(problem, found.gains, places)).tolist())
    return Design(
        loop=loop,
        gains=loop.controller.gains,
        fixed=tuple(name for name in loop.controller.gains if name not in problem.free),
        abscissa=max(one.spectral_abscissa() for one in loops),
        damping=min(dominant_damping(one)[0] for one in loops),
        margins=margins,
        delays=problem.delays,
        gain=problem.intervals.get("gain"),
        objective=objective.name,
        value=value,
        step_info=step_info(loop, problem.amplitude),
        amplitude=problem.amplitude,
        worst=found.worst,
        checked=found.checked,
        proved=proved(problem, found.gains, demands),
        traded=trades(search, demands, found, margins, value),
        charts=charts_at(problem, search.survey, found.gains),
    )
