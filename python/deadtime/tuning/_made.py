"""One design: search, check, and say what the requirements cost."""

from __future__ import annotations

from deadtime.tuning._exchange import best_gains, least_margins
from deadtime.tuning._margin_estimate import MarginEstimate
from deadtime.tuning._objectives import dominant_damping, objective_named
from deadtime.tuning._problem import pose
from deadtime.tuning._required_margins import RequiredMargins, exact_margins
from deadtime.tuning._result import Design, LeastMargins
from deadtime.tuning._search import Search
from deadtime.tuning._specification import DesignSpecification
from deadtime.tuning._step import step_info
from deadtime.tuning._survey import charts_at, surveyed
from deadtime.tuning._trades import trades
from deadtime.tuning._worst import fine, proved

__all__ = ["made", "required_margins"]


def required_margins(specification: DesignSpecification) -> RequiredMargins:
    """The margins that a design must have."""
    return RequiredMargins.checked(
        specification.gain_margin, specification.phase_margin, specification.delay_margin
    )


def made(loop: object, specification: DesignSpecification) -> Design:
    """Find the gains for a loop or plant."""
    objective = objective_named(specification.objective)
    required = required_margins(specification)
    problem = pose(loop, specification)
    survey = surveyed(problem, specification.shape)
    search = Search(problem, objective, survey, MarginEstimate(problem))
    found = best_gains(search, required)
    judged = [*fine(problem), found.worst]
    loops = [problem.at(found.gains, one) for one in judged]
    value = objective.proved(problem, found.gains, judged)
    middle = problem.at(found.gains)
    places = [*fine(problem, margins=True), found.worst]
    margins = LeastMargins(*least_margins(exact_margins(problem, found.gains, places)).tolist())
    return Design(
        loop=middle,
        gains=middle.controller.gains,
        fixed=tuple(name for name in middle.controller.gains if name not in problem.free),
        abscissa=max(one.spectral_abscissa() for one in loops),
        damping=min(dominant_damping(one)[0] for one in loops),
        margins=margins,
        delays=problem.delays,
        gain=problem.intervals.get("gain"),
        objective=objective.name,
        value=value,
        step_info=step_info(middle, problem.amplitude),
        amplitude=problem.amplitude,
        worst=found.worst,
        checked=found.checked,
        proved=proved(problem, found.gains, required),
        traded=trades(search, required, found, margins, value),
        charts=charts_at(problem, survey, found.gains),
    )
