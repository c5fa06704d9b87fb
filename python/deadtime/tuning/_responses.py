"""Designs by the responses to a load and a set point, under a largest Ms.

The kernel finds the gains over all scenarios in one call; here the loops of these are made and the
result is put together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from deadtime.loops import PI, PID, ControlLoop
from deadtime.tuning._candidates import Scenario
from deadtime.tuning._demands import Demands, white_to
from deadtime.tuning._exchange import fine, proved
from deadtime.tuning._native import RobustGains, noise_gain, robust_gains
from deadtime.tuning._problem import ObjectiveName, Problem
from deadtime.tuning._result import Design, LeastMargins, Trade, figure_in_words
from deadtime.tuning._settling import step_info

#: Objectives that are responses, and how the kernel names them: whether the integral of the error
#: of a load counts, and whether the settling time of a set point does.
RESPONSES: dict[str, tuple[bool, bool]] = {
    "load": (False, False),
    "load_ie": (True, False),
    "set_point": (False, False),
    "set_point_settling": (False, True),
}

#: Largest Ms where nothing is asked for: that of SIMC (Skogestad 2003, table 1), and in the middle
#: of what Astrom and Hagglund (2006, section 4.5) call reasonable, 1.2 to 2.
MAX_SENSITIVITY = 1.6

#: A figure at most this factor from its demand limits the design.
_ACTIVE = 1.0 + 1e-3

#: Relative loss that counts as none.
_NOTHING = 1e-3


@dataclass(frozen=True, eq=False)
class Wanted:
    """A design by responses."""

    problem: Problem
    objective: ObjectiveName
    #: Weight of the load; the rest is that of the set point.
    weight: float
    demands: Demands
    #: Further plants, whose loops must meet the demands as well.
    others: tuple[ControlLoop, ...] = ()
    #: Why the estimate behind it cannot be relied on.
    doubt: str | None = None
    #: Part of the best response to a load that an earlier end of a step may cost.
    slack: float = 0.0

    def gains(
        self,
        scenarios: Sequence[Scenario],
        corners: int,
        demands: Demands | None = None,
        *,
        slack: float | None = None,
        weight: float | None = None,
    ) -> RobustGains:
        """The best gains over these scenarios, of which the search begins with the corners.

        With a slack the weight of the reference is chosen with them, unless one is given.
        """
        problem, needed = self.problem, demands or self.demands
        loops = problem.gathered.at(scenarios)
        template = problem.loop.controller
        loops[corners:corners] = [
            other.replace(controller=template).specification.kernel for other in self.others
        ]
        by_integral, by_settling = RESPONSES[self.objective]
        margins = needed.margins
        spans = problem.given
        return robust_gains(
            loops,
            corners + len(self.others),
            problem.gathered.free,
            (self.weight, by_integral, by_settling),
            (
                needed.max_sensitivity or MAX_SENSITIVITY,
                margins.gain_margin,
                margins.phase_margin,
                margins.delay_margin,
                needed.noise_gain or math.inf,
                white_to(problem.loop, needed.bandwidth),
                needed.settling_time or math.inf,
            ),
            None if spans is None else [spans[name] for name in problem.free],
            problem.threads,
            slack=slack,
            weight=weight,
        )

    def design(self) -> Design:
        """The gains, and their properties over all scenarios."""
        problem = self.problem
        corners = [problem.middle, *(case for case in problem.corners if case != problem.middle)]
        every = [*corners, *(case for case in fine(problem) if case not in corners)]
        if not problem.loop.plant.is_rational and self.objective != "load_ie":
            raise ValueError(
                "for a plant with delays inside, responses to a load or a step cannot be "
                "computed: use objective='load_ie' or objective='abscissa'"
            )
        found, middle = self._found(every, len(corners))
        gains = found.gains
        judged = problem.candidates(corners)
        point = np.array([gains])
        margins = _least(found)
        return Design(
            loop=middle,
            gains=middle.controller.gains,
            fixed=tuple(name for name in middle.controller.gains if name not in problem.free),
            abscissa=float(judged.costs(point, "abscissa", problem.threads).max()),
            damping=float(judged.dominant(gains)[:, 0].min()),
            margins=margins,
            delays=problem.delays,
            gain=problem.intervals.get("gain"),
            objective=self.objective,
            value=found.value,
            step_info=step_info(middle, problem.amplitude),
            amplitude=problem.amplitude,
            worst=self._scenario(every, found.worst, len(corners)),
            checked=len(every) + len(self.others),
            proved=() if self.others else proved(problem, point[0], self.demands.margins),
            traded=self._trades(found, margins, every, len(corners)),
            region=problem.region,
            noise_gain=noise_gain(
                middle.specification.kernel, white_to(middle, self.demands.bandwidth)
            ),
            _problem=problem,
            _others=tuple(loop.replace(controller=middle.controller) for loop in self.others),
            _doubt=self.doubt,
        )

    def _scenario(self, every: Sequence[Scenario], place: int, corners: int) -> Scenario:
        """The scenario of a loop by its place; the middle one for a further plant."""
        if place < corners:
            return every[place]
        place -= len(self.others)
        return every[place] if place >= corners else every[0]

    def _found(self, every: Sequence[Scenario], corners: int) -> tuple[RobustGains, ControlLoop]:
        """The gains, and the loop with them; the weight of the reference too unless it is given."""
        controller = self.problem.loop.controller
        given = getattr(controller, "weight", None)
        found = self.gains(every, corners, slack=self.slack, weight=given)
        loop = self.problem.at(found.gains)
        chosen = loop.controller
        if found.weight is not None and isinstance(chosen, (PI, PID)):
            loop = loop.replace(controller=replace(chosen, weight=found.weight))
        return found, loop

    def _trades(
        self, found: RobustGains, margins: LeastMargins, every: Sequence[Scenario], corners: int
    ) -> tuple[Trade, ...]:
        """The price of each demand, of an earlier end of a step, and of the intervals."""
        made = []
        lost = (found.value - found.least) / abs(found.least)
        if lost > _NOTHING:
            words = (
                f"an earlier end of the step costs {100.0 * lost:.2g} %: without it "
                f"{figure_in_words(self.objective, found.least)}"
            )
            made.append(Trade("load_slack", self.slack, lost, True, found.least, words))
        for name, asked in self.demands.named.items():
            had = getattr(margins, name, math.nan)
            active = self._is_active(name, asked, had)
            what = f"{name.replace('_', ' ')} of {asked:g}"
            if not active:
                made.append(Trade(name, asked, had, False, found.value, f"{what} is met anyway"))
                continue
            without = found.value
            if name != "max_sensitivity":
                without = self.gains(every, corners, self.demands.without(name)).value
            lost = (found.value - without) / abs(without)
            words = f"{what} limits the design"
            if name != "max_sensitivity":
                if lost <= _NOTHING:
                    made.append(Trade(name, asked, had, False, without, f"{what} is met anyway"))
                    continue
                words += f": without it {figure_in_words(self.objective, without)}"
                words += f" (cost {100.0 * lost:.2g} %)"
            made.append(Trade(name, asked, had, True, without, words))
        if len(every) > 1:
            without = self.gains(every[:1], 1).value
            lost = (found.least - without) / abs(without)
            words = (
                "effect of the uncertainty of the plant: without it (values in the middle of "
                f"their intervals) {figure_in_words(self.objective, without)}"
            )
            made.append(Trade("interval", math.nan, math.nan, lost > _NOTHING, without, words))
        return tuple(made)

    def _is_active(self, name: str, asked: float, had: float) -> bool:
        """Does a demand limit the design? It is not known of those that are no margins."""
        if math.isnan(had):
            return True
        return had * _ACTIVE >= asked if name == "max_sensitivity" else had <= asked * _ACTIVE


def _least(found: RobustGains) -> LeastMargins:
    """Each margin at its least, Ms and Mt at their largest; delay margins as far as known."""
    each = found.margins
    late = [margins.delay_margin for margins in each if not math.isnan(margins.delay_margin)]
    return LeastMargins(
        min(margins.gain_margin for margins in each),
        min(margins.phase_margin for margins in each),
        min(late, default=math.nan),
        max(margins.max_sensitivity for margins in each),
        max(margins.max_complementary_sensitivity for margins in each),
    )
