"""`design`: gains for a loop with a delay, from a specification to a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

from deadtime.loops import PV, Controller, DerivativeFilter
from deadtime.tuning._filter_choice import filter_choice
from deadtime.tuning._made import made
from deadtime.tuning._margins import RequiredMargins
from deadtime.tuning._objectives import objective_named
from deadtime.tuning._problem import ObjectiveName, controller_template, pose, with_filter
from deadtime.tuning._result import Design


def design(
    loop: object,
    *,
    controller: type[Controller] | Controller = PV,
    delay: float | tuple[float, float] | None = None,
    gain: float | tuple[float, float] | None = None,
    objective: ObjectiveName = "abscissa",
    fixed: Mapping[str, float] | None = None,
    gain_margin: float | None = None,
    phase_margin: float | None = None,
    delay_margin: float | None = None,
    filter: DerivativeFilter | Literal["auto"] | None = None,  # noqa: A002
    ranges: Mapping[str, tuple[float, float]] | None = None,
    shape: Sequence[int] | None = None,
    amplitude: float = 1.0,
    level: float = 0.95,
    allow_indication: bool = False,
    threads: int | None = None,
) -> Design:
    """Find the gains that are best in the worst case, within margins.

    Parameters
    ----------
    loop : ControlLoop, DelayEstimate or a plant
        Plant, delay, hold and limit; its controller is replaced. With an estimate the gains are the
        best for the worst loop of its joint confidence region of delay, gain and lag. A plant of
        any kind that `ControlLoop` takes stands for the continuous loop around it without a limit.
    controller : Controller or class of one
        `P`, `PV`, `PD`, `PI`, `PID`, or an instance whose other numbers, such as the filter of
        its derivative, are to be kept.
    delay : float or (float, float), optional
        The delay, s, or the interval it lies in: the gains are then the best for the worst delay
        of the whole interval. The loop's own delay if not given. For a plant with a delay in
        series, what comes on top of that.
    gain : float or (float, float), optional
        The same for the plant's gain.
    objective : {"abscissa", "damping", "settling_time", "overshoot"}
        Make the spectral abscissa smallest (the most stable gains); the damping ratio of the
        dominant poles largest; the 2 % settling time of a step smallest, hold and limit included;
        or its overshoot smallest, which is the fastest step that overshoots by at most 0.1 % where
        there is one. Steps are judged for gains half a percent beside these too, which rounding
        to three digits may give, and the result's are proved to stay in the band for ever.
    fixed : mapping of str to float, optional
        Gains that are given; the others are found.
    gain_margin, phase_margin, delay_margin : float, optional
        Least margins in all of the intervals: a factor above 1, degrees, s. Exact ones: of a
        sampled loop with its hold.
    filter : DerivativeFilter or "auto", optional
        The filter of the derivative, in place of that of `controller`; ``"auto"`` chooses its
        corner as `design_filter` does.
    ranges : mapping of str to (float, float), optional
        Where to look for each free gain. If not given, from the stability limit under proportional
        control, negative for a plant that needs negative gains; where no proportional gain is
        stable, around what the plant's response at one over the delay asks for.
    shape : tuple of int, optional
        Points of the map that the search starts from, along each free gain.
    amplitude : float
        Height of the step; with a limit it matters.
    level : float
        Probability of the region of an estimate. The true loop has the margins of the design at
        least as probably, where the model of the estimate is right.
    allow_indication : bool
        Design also for an estimate that is an indication. Its region has no known
        probability, so neither have the margins.
    threads : int, optional
        Number of threads; all cores if not given.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        When the delay is not known, no gains in the ranges are stable, or none of them meet the
        margins; the message says what was searched, or which margins are possible. When an
        estimate is an indication, or has no intervals.
    TypeError
        When `loop` is neither a `ControlLoop` nor a plant, or `fixed` or `ranges` no mapping.

    Examples
    --------
    The paper's loop has the gain 2 and a velocity gain of 0.3, with an abscissa of -3.317. The
    best is where other roots take over from the ones that moved left:

    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
    >>> best = dtm.design(loop, fixed={"Kp": 2.0})
    >>> round(best.gains["Kv"], 4), round(best.abscissa, 4)
    (0.2415, -3.6841)

    For a delay known to an interval, and with a margin:

    >>> smooth = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))
    >>> best = dtm.design(loop, controller=smooth, delay=(0.3, 0.4), gain_margin=4.0)
    >>> best.margins.gain_margin >= 4.0, best.proved
    (True, ('stable', 'gain_margin'))
    >>> print(best.traded[0].words)
    gain margin of at least 4 holds the design back: without it ...
    """
    template = controller_template(controller)
    if isinstance(filter, DerivativeFilter):
        template = with_filter(template, filter)
    elif filter not in (None, "auto"):
        raise ValueError(f"filter={filter!r}: give a DerivativeFilter, 'auto' or None")
    goal = objective_named(objective)
    required = RequiredMargins.checked(gain_margin, phase_margin, delay_margin)
    problem = pose(
        loop, template, delay, gain, fixed, ranges, amplitude, threads, level, allow_indication
    )
    if filter != "auto":
        return made(problem, goal, required, shape)
    choice = filter_choice(problem, goal, required, shape)
    traded = (*choice.design.traded, choice.trade)
    return replace(choice.design, filter_choice=choice, traded=traded)
