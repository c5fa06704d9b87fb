"""Results of a design: gains, their properties, and what the requirements cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite, nan
from typing import NamedTuple

from deadtime._base.arrays import Array
from deadtime._base.digits import between
from deadtime._base.drawing import Figure
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime.loops import Controller, ControlLoop, Explorer, explorer_of
from deadtime.stability import StabilityMap
from deadtime.tuning._candidates import Scenario
from deadtime.tuning._demands import limit_in_words
from deadtime.tuning._gate import Gate, gate_of_loops
from deadtime.tuning._problem import ObjectiveName, Problem
from deadtime.tuning._region import ConfidenceRegion
from deadtime.tuning._rules import RuleTable, compared
from deadtime.tuning._survey import Survey, charts_at


class LeastMargins(NamedTuple):
    """Margins at their worst over all that is not known; each may have its own worst scenario."""

    gain_margin: float
    """Factor on the loop gain."""
    phase_margin: float
    """Degrees."""
    delay_margin: float
    """Further delay, s."""
    max_sensitivity: float
    """Ms, at its largest."""
    max_complementary_sensitivity: float
    """Mt, at its largest."""


@dataclass(frozen=True, eq=False)
class Trade(ReadOnlyArrays):
    """What one requirement costs.

    Attributes
    ----------
    requirement : str
        The name of a demand of `design`, ``"load_slack"`` (for a step that settles earlier),
        ``"all_margins"``, ``"interval"`` (of delay and gain) or ``"filter"``.
    required, achieved : float
        What was required and what the design has; NaN where that is no number.
    active : bool
        Whether the design is held back by it.
    without : float
        The objective's value of the best gains without it.
    words : str
        The same as a sentence.
    """

    requirement: str
    required: float
    achieved: float
    active: bool
    without: float
    words: str


@dataclass(frozen=True, eq=False, repr=False)
class Design(ReadOnlyArrays, Pictured):
    """Gains, and the loop that has them; made by `design`.

    Attributes
    ----------
    loop : ControlLoop
        The loop with the gains, delay and gain of the plant at the middles of their intervals.
    gains : dict of str to float
        All gains of the controller, fixed ones included.
    fixed : tuple of str
        Names of those that were given.
    abscissa : float
        Spectral abscissa with these gains, 1/s, the largest over the intervals; negative: stable.
    damping : float
        Smallest damping ratio of the dominant poles (those that decay at most three times as fast
        as the slowest) over the intervals.
    margins : LeastMargins
        Exact margins, hold and delay included, each at its least over the intervals.
    delays : tuple of float
        Ends and middle of the delay's interval, s.
    gain : (float, float) or None
        Interval of the plant's gain, if one was given.
    objective : str
        What was made best, one of the objectives of `design`.
    value : float
        What it came out at in the worst scenario: an integral, 1/s, a ratio, s or %. Of a settling
        time or an overshoot the worst for gains half a percent beside these as well, so that they
        may be rounded to three digits.
    step_info : dict of str to float
        The step of `amplitude` in `loop`, hold and limit included: `Response.info`, and
        ``peak_command`` and ``time_at_limit`` (s, 0 without a limit). The settling time is proved
        for all times, NaN where it is not.
    amplitude : float
        Height of the step.
    worst : dict of str to float
        The scenario in which the objective is worst.
    checked : int
        How many scenarios the objective was checked in after the search.
    proved : tuple of str
        What of ``"stable"``, ``"gain_margin"`` and ``"delay_margin"`` is proved for every value
        in the intervals; empty for sampled loops, which are checked on the scenarios.
    traded : tuple of Trade
        What each requirement cost.
    noise_gain : float
        Standard deviation of the command over that of white measurement noise, with `loop`.
    filter_choice : FilterChoice or None
        Where the filter's corner was chosen, how.
    region : ConfidenceRegion or None
        The region of the estimate it was designed for. The margins are the least over it, so that
        the true loop has them with the probability `region.level` where its verdict is reliable.
    """

    loop: ControlLoop
    gains: dict[str, float]
    fixed: tuple[str, ...]
    abscissa: float
    damping: float
    margins: LeastMargins
    delays: tuple[float, ...]
    gain: tuple[float, float] | None
    objective: ObjectiveName
    value: float
    step_info: dict[str, float]
    amplitude: float
    worst: Scenario
    checked: int
    proved: tuple[str, ...]
    traded: tuple[Trade, ...]
    noise_gain: float = nan
    filter_choice: FilterChoice | None = None
    region: ConfidenceRegion | None = None
    _problem: Problem | None = field(default=None, repr=False)
    _survey: Survey | None = field(default=None, repr=False)
    _others: tuple[ControlLoop, ...] = field(default=(), repr=False)
    _doubt: str | None = field(default=None, repr=False)

    @cached_property
    def charts(self) -> tuple[StabilityMap, ...]:
        """Maps of the gains for each of `delays`; of one free gain a single one.

        They are made when they are first asked for.
        """
        if self._problem is None:
            return ()
        gains = [self.gains[name] for name in self._problem.free]
        return charts_at(self._problem, self._survey, gains)

    def __repr__(self) -> str:
        kind = type(self.loop.controller).__name__
        gains = ", ".join(f"{name} = {gain:.4g}" for name, gain in self.gains.items())
        return (
            f"<Design {kind}, {gains}: spectral abscissa {self.abscissa:.4g} 1/s at a delay of "
            f"{self._late()} s>"
        )

    def _late(self) -> str:
        ends = dict.fromkeys((self.delays[0], self.delays[-1]))
        return " to ".join(f"{end:g}" for end in ends)

    def compared(self) -> RuleTable:
        """Return the gains by rules of thumb beside those of the design, with what each gives.

        Returns
        -------
        RuleTable
            As of `rules`, the design first. All of them on `loop`, where what is not known is in
            the middle.

        Raises
        ------
        ValueError
            As in `rules`.
        """
        return compared(self.loop, "design")

    def gate(
        self,
        *,
        flown: Controller | Mapping[str, float] | None = None,
        noise: float | None = None,
        override: bool = False,
    ) -> Gate:
        """Return whether the gains may be set in a machine, and why not.

        Parameters
        ----------
        flown : Controller or mapping of str to float, optional
            The gains that the machine has now; a change is not judged if not given.
        noise : float, optional
            Standard deviation of the measurement noise.
        override : bool
            Set aside that the estimate is an indication; the result says so.

        Returns
        -------
        Gate
            As of `check_gains`, over all that was not known to the design.
        """
        problem, region = self._problem, self.region
        every = [self.loop, *self._others]
        if problem is not None:
            gains = [self.gains[name] for name in problem.free]
            spread = problem.scenarios(3) if region is None else region.points
            every += [problem.at(gains, scenario) for scenario in spread]
        doubt = self._doubt
        if region is not None and region.verdict != "reliable":
            doubt = "the estimate is only an indication"
        return gate_of_loops(every, doubt, flown, noise, override)

    def explore(self) -> Explorer:
        """Return a page with the designed loop and the interval of its delay.

        Returns
        -------
        deadtime.loops.Explorer
            See `deadtime.ControlLoop.explore`.

        Raises
        ------
        ValueError
            If the explorer has no such loop.
        """
        ends = (min(self.delays), max(self.delays))
        interval = ends if ends[0] < ends[1] else None
        return explorer_of(self.loop.specification, interval=interval)

    def summary(self) -> str:
        """Gains, their properties and what the requirements cost, in a few lines.

        Returns
        -------
        str
        """
        gains = ", ".join(
            f"{name} = {value:.4g}{' (given)' if name in self.fixed else ''}"
            for name, value in self.gains.items()
        )
        weight = getattr(self.loop.controller, "weight", None)
        if weight is not None:
            gains += f", weight of the set point {weight:.3g}"
        over = f"over a delay of {self._late()} s"
        if self.gain is not None:
            over += f" and a gain of {self.gain[0]:g} to {self.gain[1]:g}"
        if self.region is not None:
            over = f"over {_in_words(self.region)}"
        info, least = self.step_info, self.margins
        proof = f"; proved: {', '.join(self.proved).replace('_', ' ')}" if self.proved else ""
        settled = info["settling_time"]
        step = f"settles in {settled:.3g} s" if isfinite(settled) else "not proved to settle"
        step += f", overshoot {info['overshoot']:.2g} %, peak command {info['peak_command']:.3g}"
        if self.loop.limit is not None:
            step += f", {info['time_at_limit']:.2g} s at the limit of {limit_in_words(self.loop)}"
        lines = [
            f"{type(self.loop.controller).__name__}: {gains}",
            f"worst {over}: {figure_in_words(self.objective, self.value)}; spectral abscissa "
            f"{self.abscissa:.4g} 1/s, damping ratio {self.damping:.3g}",
            f"least margins: gain {least.gain_margin:.4g}, phase "
            f"{least.phase_margin:.4g}°, delay {least.delay_margin:.4g} s; Ms at most "
            f"{least.max_sensitivity:.4g} "
            f"({self.checked} scenario{'' if self.checked == 1 else 's'} checked{proof})",
            f"step of {self.amplitude:g}: {step}",
        ]
        if self.region is not None:
            lines.insert(3, _probability(self.region))
        lines += [trade.words for trade in self.traded]
        return "\n".join(lines)

    def _picture(self) -> Figure:
        return self.plot()

    def plot(self) -> Figure:
        """Draw map, step response, and the Bode plot of the loop with its margins.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        from deadtime.tuning._plots import plot_design

        return plot_design(self)


def _in_words(region: ConfidenceRegion) -> str:
    """The region with the range of each number."""
    ranges = [
        f"{name.replace('_', ' ')} {between(low, high, nan, '' if name == 'gain' else 's')}"
        for name, (low, high) in region.intervals.items()
        if low < high
    ]
    return f"the joint {100.0 * region.level:g} % region of the estimate ({', '.join(ranges)})"


def _probability(region: ConfidenceRegion) -> str:
    """With which probability the true loop has the least margins."""
    if region.verdict == "reliable":
        return f"the true loop has these margins with a probability of {100.0 * region.level:g} %"
    return (
        "the estimate is only an indication, so the probability that the true loop has these "
        "margins is not known"
    )


def figure_in_words(objective: ObjectiveName, value: float) -> str:
    """The value of an objective with its name and unit."""
    return {
        "abscissa": f"abscissa {value:.5g} 1/s",
        "damping": f"damping ratio {value:.3g}",
        "settling_time": f"settling time {value:.4g} s",
        "overshoot": f"overshoot {value:.3g} %",
        "load": f"response to a unit load {value:.4g} (IAE, or deviation at rest)",
        "load_ie": f"response to a unit load {value:.4g} (IE, or deviation at rest)",
        "set_point": f"response to a unit set point {value:.4g} (IAE)",
        "set_point_settling": f"settling time {value:.4g} s",
    }[objective]


@dataclass(frozen=True, eq=False, repr=False)
class FilterChoice(ReadOnlyArrays, Pictured):
    """How the corner of a filter was chosen; made by `design_filter`.

    Attributes
    ----------
    omega : float
        The corner that was chosen, rad/s.
    rule : str
        Why that one.
    design : Design
        The design with it.
    ideal : Design
        The design without a filter.
    omegas : ndarray, shape (n,)
        Corners that were tried, rad/s.
    values : ndarray, shape (n,)
        The objective at each, with the best gains for it; NaN where none meet the requirements.
    noise_gains : ndarray, shape (n,)
        Standard deviation of the command over that of the measurement noise, at each.
    value, noise_gain : float
        The same of the chosen one.
    ideal_noise_gain : float
        The same without a filter.
    bandwidth : float
        Up to where the noise is white, rad/s.
    noise : float or None
        Standard deviation of the measurement noise, where it was given.
    """

    omega: float
    rule: str
    design: Design
    ideal: Design
    omegas: Array
    values: Array
    noise_gains: Array
    value: float
    noise_gain: float
    ideal_noise_gain: float
    bandwidth: float
    noise: float | None

    def __repr__(self) -> str:
        return (
            f"<FilterChoice {self.omega:.4g} rad/s: "
            f"{figure_in_words(self.design.objective, self.value)}, noise gain "
            f"{self.noise_gain:.3g}>"
        )

    @property
    def trade(self) -> Trade:
        """The cost of the filter, as a `Trade`."""
        return Trade("filter", self.omega, self.omega, True, self.ideal.value, self.summary())

    def summary(self) -> str:
        """The choice in a sentence.

        Returns
        -------
        str
        """
        name = self.design.objective
        words = (
            f"filter at {self.omega:.4g} rad/s, {self.rule}: "
            f"{figure_in_words(name, self.value)}, without a filter "
            f"{figure_in_words(name, self.ideal.value)}. The noise of the command is "
            f"{self.noise_gain:.3g} times the noise of the measurement (white to "
            f"{self.bandwidth:.4g} rad/s), without a filter {self.ideal_noise_gain:.3g} times"
        )
        if self.noise is not None:
            words += f", which is a standard deviation of {self.noise * self.noise_gain:.3g}"
        return words

    def _picture(self) -> Figure:
        return self.plot()

    def plot(self) -> Figure:
        """Draw the costs of each corner, the controller with and without filter, and the margins.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        from deadtime.tuning._plots import plot_filter_choice

        return plot_filter_choice(self)
