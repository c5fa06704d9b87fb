"""`design`: gains for a loop with a delay, from a specification to a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, get_args

from deadtime._base.validation import finite, non_negative
from deadtime.estimation import PlantEstimate
from deadtime.loops import PI, PID, PV, Controller, ControlLoop, DerivativeFilter
from deadtime.tuning._demands import Demands
from deadtime.tuning._filter_choice import filter_choice
from deadtime.tuning._found_plants import possible_loops, refusal
from deadtime.tuning._made import made
from deadtime.tuning._margins import RequiredMargins
from deadtime.tuning._native import LOAD_SLACK
from deadtime.tuning._objectives import objective_named
from deadtime.tuning._problem import ObjectiveName, controller_template, pose, with_filter
from deadtime.tuning._responses import RESPONSES, Wanted
from deadtime.tuning._result import Design


def design(
    loop: object,
    *,
    controller: type[Controller] | Controller = PV,
    delay: float | tuple[float, float] | None = None,
    gain: float | tuple[float, float] | None = None,
    objective: ObjectiveName = "load",
    load_weight: float | None = None,
    load_slack: float | None = None,
    plants: Sequence[object] = (),
    fixed: Mapping[str, float] | None = None,
    max_sensitivity: float | None = None,
    gain_margin: float | None = None,
    phase_margin: float | None = None,
    delay_margin: float | None = None,
    noise_gain: float | None = None,
    bandwidth: float | None = None,
    settling_time: float | None = None,
    filter: DerivativeFilter | Literal["auto"] | None = None,  # noqa: A002
    ranges: Mapping[str, tuple[float, float]] | None = None,
    shape: Sequence[int] | None = None,
    amplitude: float = 1.0,
    level: float = 0.95,
    allow_indication: bool = False,
    threads: int | None = None,
) -> Design:
    """Find the gains that are best in the worst case, within margins.

    By default the best response to a load with Ms of at most 1.6 over all that is not known.

    Parameters
    ----------
    loop : ControlLoop, DelayEstimate, PlantEstimate or a plant
        Plant, delay, hold and limit; its controller is replaced. With a `PlantEstimate`, for loads
        and set points, the gains hold for all plants that it leaves possible: the ends of delay, of
        its sum with the lags and of the gain, and other kinds that are not ruled out. With an
        estimate the gains are the best for the worst loop of its joint confidence region of delay,
        gain and lag. A plant of
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
    objective : str
        ``"load"``, the default: the response to a step of a load at the plant's input, the integral
        of its modulus (IAE) for a unit load. ``"load_ie"``: the integral of the error, which is
        1/abs(Ki). Without an integral term both are the deviation at rest, abs(P/(1 + P Kp)) with
        the steady gain P of the plant, 1/abs(Kp) of an integrating one. ``"set_point"``: the
        integral of abs(y - rest) after a unit step of the reference. ``"set_point_settling"``: its
        2 % settling time. The limit is left out of all four.
        ``"abscissa"``: the spectral abscissa smallest (the most stable gains). ``"damping"``: the
        damping ratio of the dominant poles largest. ``"settling_time"``: the 2 % settling time of
        a step smallest, hold and limit included. ``"overshoot"``: its overshoot smallest, which is
        the fastest step that overshoots by at most 0.1 % where there is one. For the last two steps
        are judged for gains half a percent beside these too, which rounding to three digits may
        give, and the result's are proved to stay in the band for ever.
    load_weight : float, optional
        Weight of the load between 0 and 1 where load and set point both count, each in units of the
        best that can be had of it alone; the set point has the rest. 1 for the loads, 0 for the set
        points if not given.
    load_slack : float, optional
        Part of the best response to a load that may be lost where a step of the reference settles
        earlier for it, with PI and PID control and ``"load"``; 0.1 if not given, and 0 with any
        demand. The weight of the reference is chosen for that too, unless `controller` gives one.
    plants : sequence of ControlLoop or plants, optional
        Further ones that the same gains must hold for, with their own delays.
    fixed : mapping of str to float, optional
        Gains that are given; the others are found.
    max_sensitivity : float, optional
        Largest Ms in all of the intervals; 1.6 if not given. For loads and set points.
    gain_margin, phase_margin, delay_margin : float, optional
        Least margins in all of the intervals: a factor above 1, degrees, s. Exact ones: of a
        sampled loop with its hold.
    noise_gain : float, optional
        Largest standard deviation of the command over that of measurement noise, which is white up
        to `bandwidth`. For loads and set points.
    bandwidth : float, optional
        Up to where the noise is white, rad/s; pi/sample_time if not given, and of a continuous loop
        100 over delay and lag.
    settling_time : float, optional
        Longest 2 % settling time of a step of the reference, s, the limit left out. For loads and
        set points.
    filter : DerivativeFilter or "auto", optional
        The filter of the derivative, in place of that of `controller`; ``"auto"`` chooses its
        corner as `design_filter` does, which knows no loads and set points.
    ranges : mapping of str to (float, float), optional
        Where to look for each free gain. If not given, loads and set points look at all ratios of
        the gains up to hundreds of times their time scale; the others from the stability limit
        under proportional control, negative for a plant that needs negative gains; where no
        proportional gain is stable, around what the plant's response at one over the delay asks
        for.
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

    Notes
    -----
    Loads and set points are sought along rays of gains: what Ms excludes on each is known at all
    frequencies at once, and the rest is a search over the ratios of the gains. The margins of the
    result are exact in every scenario; that there are no better gains is not proved.

    Examples
    --------
    A process with a lag of 10 s, a dead time of 2 s and PI control:

    >>> import deadtime as dtm
    >>> process = dtm.ControlLoop(dtm.FirstOrder(2.0, 10.0), dtm.PI(1.0, 0.1), delay=2.0)
    >>> best = dtm.design(process, controller=dtm.PI)
    >>> round(best.margins.max_sensitivity, 6)
    1.6

    The paper's loop has the gain 2 and a velocity gain of 0.3, with an abscissa of -3.317. The
    best is where other roots take over from the ones that moved left:

    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
    >>> best = dtm.design(loop, fixed={"Kp": 2.0}, objective="abscissa")
    >>> round(best.gains["Kv"], 4), round(best.abscissa, 4)
    (0.2415, -3.6841)

    For a delay known to an interval, and with a margin:

    >>> smooth = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))
    >>> best = dtm.design(
    ...     loop, controller=smooth, delay=(0.3, 0.4), objective="abscissa", gain_margin=4.0
    ... )
    >>> best.margins.gain_margin >= 4.0, best.proved
    (True, ('stable', 'gain_margin'))
    >>> print(best.traded[0].words)
    gain margin of at least 4 limits the design: without it ...
    """
    template = controller_template(controller)
    if isinstance(filter, DerivativeFilter):
        template = with_filter(template, filter)
    elif filter not in (None, "auto"):
        raise ValueError(f"filter={filter!r}: give a DerivativeFilter, 'auto' or None")
    required = RequiredMargins.checked(gain_margin, phase_margin, delay_margin)
    demands = Demands.checked(required, max_sensitivity, noise_gain, settling_time, bandwidth)
    names = get_args(ObjectiveName)
    if objective not in names:
        raise ValueError(f"objective={objective!r}: give one of {', '.join(map(repr, names))}")
    doubt = None
    if isinstance(loop, PlantEstimate):
        if objective not in RESPONSES:
            raise ValueError(
                f"objective={objective!r} cannot be used with a PlantEstimate: give one of the "
                f"objectives {', '.join(map(repr, RESPONSES))}, or the likeliest loop alone, "
                "estimate.loop(controller)"
            )
        doubt = refusal(loop)
        if doubt is not None and not allow_indication:
            raise ValueError(
                f"the estimate is only an indication ({doubt}), so the margins of a design "
                "based on this estimate are not known. For gains without known margins, give "
                "allow_indication=True"
            )
        loop, *around = possible_loops(loop, template, level)
        plants = (*plants, *around)
    problem = pose(
        loop, template, delay, gain, fixed, ranges, amplitude, threads, level, allow_indication
    )
    if objective in RESPONSES:
        if filter == "auto":
            raise ValueError(
                f"objective={objective!r} cannot choose the corner of a filter: give a "
                "DerivativeFilter instead of filter='auto', or the objective 'abscissa', "
                "'damping' or 'settling_time'"
            )
        weight = _load_weight(objective, load_weight)
        slack = _load_slack(objective, weight, load_slack, demands, template)
        others = _loops_of(plants, template)
        wanted = Wanted(problem, objective, weight, demands, others, doubt, slack)
        return wanted.design()
    goal = objective_named(objective)
    only = {"load_weight": load_weight, "load_slack": load_slack, "bandwidth": bandwidth}
    _refuse_responses(objective, demands, only, plants)
    if filter != "auto":
        return made(problem, goal, required, shape)
    choice = filter_choice(problem, goal, required, shape)
    traded = (*choice.design.traded, choice.trade)
    return replace(choice.design, filter_choice=choice, traded=traded)


def _load_weight(objective: ObjectiveName, given: float | None) -> float:
    if given is None:
        return 1.0 if objective in ("load", "load_ie") else 0.0
    weight = finite("load_weight", given)
    if not 0.0 <= weight <= 1.0:
        raise ValueError(f"load_weight={weight}: give a number between 0 and 1")
    return weight


def _load_slack(
    objective: ObjectiveName,
    weight: float,
    given: float | None,
    demands: Demands,
    template: Controller,
) -> float:
    counts = objective == "load" and weight == 1.0
    if given is None:
        return LOAD_SLACK if counts and not demands.named else 0.0
    if not counts or not isinstance(template, (PI, PID)):
        raise ValueError(
            f"load_slack={given} applies only to objective='load' with PI or PID control and "
            "without load_weight. Leave load_slack out"
        )
    return non_negative("load_slack", given)


def _loops_of(plants: Sequence[object], template: Controller) -> tuple[ControlLoop, ...]:
    """The loops around further plants."""
    return tuple(
        plant if isinstance(plant, ControlLoop) else ControlLoop(plant, template)
        for plant in plants
    )


def _refuse_responses(
    objective: ObjectiveName,
    demands: Demands,
    only: Mapping[str, float | None],
    plants: Sequence[object],
) -> None:
    """Raise where what belongs to loads and set points is given with another objective."""
    given = list(demands.beyond_margins)
    given += [name for name, value in only.items() if value is not None]
    given += ["plants"] * bool(plants)
    if given:
        raise ValueError(
            f"{', '.join(given)} cannot be used with objective={objective!r}: give one of the "
            f"objectives {', '.join(map(repr, RESPONSES))}"
        )
