"""The corner of a derivative's filter: noise of the command against what the delay of it costs.

A slow filter takes noise off the command and adds delay to the loop. For each corner the gains are
designed anew, so that both sides are at their best, and two figures are set against each other:

the objective, against that with the ideal derivative;
the noise gain, the standard deviation of the command over that of the measurement noise, for
noise that is white up to a bandwidth B and circulates in the loop:

    gain^2 = (1/B) * integral from 0 to B of abs(F / (1 + L))^2 d omega

with the controller's feedback F and the loop gain L (of a sampled loop, with its hold; B is half
its sampling rate, below which no noise is folded). An ideal derivative gives Kp^2 + Kv^2 B^2/3
where L is small: without a filter the noise gain is as large as the bandwidth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.validation import increasing, positive
from deadtime.loops import PV, Controller, ControlLoop, DerivativeFilter
from deadtime.tuning._exchange import best_gains
from deadtime.tuning._made import made, required_margins
from deadtime.tuning._margin_estimate import MarginEstimate
from deadtime.tuning._objectives import Objective, objective_named
from deadtime.tuning._problem import Problem, Vector, controller_template, pose, with_filter
from deadtime.tuning._result import Design, FilterChoice
from deadtime.tuning._search import Search
from deadtime.tuning._specification import (
    DesignSpecification,
    FilterSpecification,
    ObjectiveName,
)
from deadtime.tuning._survey import Survey, surveyed
from deadtime.tuning._worst import fine

__all__ = ["design_filter", "filter_choice", "noise_gain"]

#: Number of corners tried, and the slowest and fastest in units of 1/(delay + lag + half a sample).
#: Each corner costs a design.
_CORNERS = 11
_SLOWEST, _FASTEST = 2.0, 200.0

#: Bandwidth of the noise of a continuous loop, which has no sampling rate, as a multiple of the
#: fastest corner.
_BEYOND = 10.0

#: Halvings of the interval between two corners: each costs a design and halves the error.
_HALVINGS = 5

#: Points of the integral over the noise, and its lower end as a fraction of the bandwidth.
_POINTS = 4000
_LOWEST = 1e-5

#: Points of the map along each gain, for one, two and three free gains: fewer than for one design,
#: since many maps are computed.
_SIDE = {1: 201, 2: 41, 3: 15}


def design_filter(
    loop: object,
    *,
    controller: type[Controller] | Controller = PV,
    loss: float = 0.1,
    noise: float | None = None,
    command_noise: float | None = None,
    omegas: ArrayLike | None = None,
    damping: float = 1.0,
    bandwidth: float | None = None,
    delay: float | tuple[float, float] | None = None,
    gain: float | tuple[float, float] | None = None,
    objective: ObjectiveName = "abscissa",
    fixed: Mapping[str, float] | None = None,
    gain_margin: float | None = None,
    phase_margin: float | None = None,
    delay_margin: float | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    shape: Sequence[int] | None = None,
    amplitude: float = 1.0,
    threads: int | None = None,
) -> FilterChoice:
    """Choose the corner of the derivative's filter, and the gains with it.

    Parameters
    ----------
    loop : ControlLoop or a plant
        As in `design`.
    controller : Controller or class of one
        With a derivative: `PV`, `PD` or `PID`.
    loss : float
        The slowest filter is chosen with which the objective is at most this part worse than
        without a filter.
    noise, command_noise : float, optional
        Standard deviations of the measurement noise and of the noise of the command it may cause
        at most. With both, the fastest filter is chosen that keeps to it, and `loss` plays no part.
    omegas : array_like, optional
        Corners to try, rad/s, increasing; by default from 2 to 200 over the sum of delay, lag and
        half a sample.
    damping : float
        Damping ratio of the filter.
    bandwidth : float, optional
        Up to where the noise is white, rad/s: pi/sample_time by default, of a continuous loop ten
        times the fastest corner.
    delay, gain, objective, fixed, gain_margin, phase_margin, delay_margin, ranges, shape
        As in `design`.
    amplitude, threads
        As in `design`.

    Returns
    -------
    FilterChoice

    Raises
    ------
    ValueError
        As in `design`; also if the controller has no derivative, the objective is the overshoot
        (which is none with any filter), or no corner keeps to the rule.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36, sample_time=0.065)
    >>> choice = dtm.design_filter(loop, fixed={"Kp": 2.0}, omegas=[10, 20, 40, 80, 160])
    >>> choice.value <= 0.9 * choice.ideal.value
    True
    >>> choice.noise_gain < choice.ideal_noise_gain
    True
    """
    specification = DesignSpecification(
        controller=controller,
        delay=delay,
        gain=gain,
        objective=objective,
        fixed=fixed,
        gain_margin=gain_margin,
        phase_margin=phase_margin,
        delay_margin=delay_margin,
        ranges=ranges,
        shape=shape,
        amplitude=amplitude,
        threads=threads,
    )
    wanted = FilterSpecification(loss, noise, command_noise, omegas, damping, bandwidth)
    return filter_choice(loop, specification, wanted)


def filter_choice(
    loop: object, specification: DesignSpecification, wanted: FilterSpecification
) -> FilterChoice:
    """Check the arguments, design with every corner, and choose."""
    if objective_named(specification.objective).name == "overshoot":
        raise ValueError(
            "objective='overshoot': it can be none with any filter; choose by 'abscissa', "
            "'damping' or 'settling_time'"
        )
    if wanted.noise is None and wanted.command_noise is not None:
        raise ValueError("command_noise without noise: give the standard deviation of both")
    template = controller_template(specification.controller)
    specification = replace(specification, controller=with_filter(template, None))
    ideal_problem = pose(loop, specification)
    if specification.shape is None:
        free = len(ideal_problem.free)
        specification = replace(specification, shape=(_SIDE[free],) * free)
    corners = _corners(ideal_problem, wanted.omegas)
    bandwidth = _bandwidth(ideal_problem.loop, wanted.bandwidth, float(corners[-1]))
    ideal = made(loop, specification)
    survey = surveyed(ideal_problem, specification.shape)
    task = _Task(loop, specification, wanted.damping, bandwidth, survey)
    # From the fastest corner down, each from the gains of the one before: they change slowly.
    gains = np.array([ideal.gains[name] for name in ideal_problem.free])
    tried: list[_Tried] = []
    for corner in corners[::-1]:
        tried.insert(0, task.tried(float(corner), gains))
        gains = tried[0].gains
    if wanted.noise is not None and wanted.command_noise is not None:
        most = positive("command_noise", wanted.command_noise) / positive("noise", wanted.noise)
        rule = f"the fastest with a command noise of at most {wanted.command_noise:g}"
        omega = _fastest(task, corners, tried, most)
    else:
        loss = positive("loss", wanted.loss)
        rule = f"the slowest that loses at most {100 * loss:g} %"
        omega = _slowest(task, corners, tried, ideal, loss)
    chosen = made(loop, task.specified(omega))
    return FilterChoice(
        omega=omega,
        rule=rule,
        design=chosen,
        ideal=ideal,
        omegas=corners,
        values=np.array([one.value for one in tried]),
        noise_gains=np.array([one.noise_gain for one in tried]),
        value=chosen.value,
        noise_gain=noise_gain(chosen.loop, bandwidth),
        ideal_noise_gain=noise_gain(ideal.loop, bandwidth),
        bandwidth=bandwidth,
        noise=wanted.noise,
    )


def noise_gain(loop: ControlLoop, bandwidth: float) -> float:
    """Standard deviation of the command over that of white measurement noise, up to `bandwidth`."""
    omega = np.geomspace(_LOWEST * bandwidth, bandwidth, _POINTS)
    feedback = loop.controller.transfer_function().frequency_response(omega)
    squared = np.abs(feedback / (1.0 + loop.frequency_response(omega))) ** 2
    return float(np.sqrt(np.trapezoid(squared, omega) / bandwidth))


@dataclass(frozen=True)
class _Tried:
    """The objective, the noise gain and the best gains with one corner."""

    value: float
    noise_gain: float
    gains: Vector


@dataclass(frozen=True, eq=False)
class _Task:
    """Everything but the corner."""

    loop: object
    specification: DesignSpecification
    damping: float
    bandwidth: float
    survey: Survey

    @property
    def objective(self) -> Objective:
        return objective_named(self.specification.objective)

    def specified(self, corner: float) -> DesignSpecification:
        """The design with one corner of the filter."""
        ideal = controller_template(self.specification.controller)
        smooth = with_filter(ideal, DerivativeFilter(corner, self.damping))
        return replace(self.specification, controller=smooth)

    def tried(self, corner: float, start: Vector) -> _Tried:
        """Design with one corner from the gains of another; NaN where none meet the margins."""
        problem = pose(self.loop, self.specified(corner))
        alone = len(start) == 1
        try:
            # A map over one gain costs next to nothing.
            survey = surveyed(problem, self.specification.shape) if alone else self.survey
            search = Search(problem, self.objective, survey, MarginEstimate(problem))
            required = required_margins(self.specification)
            found = best_gains(search, required, None if alone else start)
        except ValueError:
            return _Tried(math.nan, math.nan, start)
        value = self.objective.value(problem, found.gains, [*fine(problem), found.worst])
        return _Tried(value, noise_gain(problem.at(found.gains), self.bandwidth), found.gains)


def _corners(problem: Problem, omegas: ArrayLike | None) -> Vector:
    if omegas is not None:
        corners = np.array(increasing("omegas", omegas))
        if corners.size < 2 or corners[0] <= 0.0:
            raise ValueError("omegas: give at least two increasing corners above zero")
        return corners
    numbers = problem.loop.parameters
    late = problem.intervals["delay"][1] + numbers.get("lag", 0.0)
    late += 0.5 * numbers.get("sample_time", 0.0)
    if late == 0.0:
        raise ValueError("the loop has no delay, lag or sample time to measure by: give omegas=")
    return np.geomspace(_SLOWEST / late, _FASTEST / late, _CORNERS)


def _bandwidth(loop: ControlLoop, bandwidth: float | None, fastest: float) -> float:
    if loop.sample_time is None:
        return _BEYOND * fastest if bandwidth is None else positive("bandwidth", bandwidth)
    half = np.pi / loop.sample_time
    white = half if bandwidth is None else positive("bandwidth", bandwidth)
    if white > half:
        raise ValueError(
            f"bandwidth={white}: noise beyond {half:.4g} rad/s, half the sampling rate, is folded "
            "into what lies below; give it as the samples see it"
        )
    return float(white)


def _slowest(
    task: _Task, corners: Vector, tried: Sequence[_Tried], ideal: Design, loss: float
) -> float:
    """The slowest corner that loses no more, between the corners tried too."""

    def keeps(one: _Tried) -> bool:
        return task.objective.lost(one.value, ideal.value) <= loss

    kept = [i for i, one in enumerate(tried) if keeps(one)]
    if not kept:
        lost = [task.objective.lost(one.value, ideal.value) for one in tried]
        if not np.isfinite(lost).any():
            raise ValueError("no corner has gains with the required margins: require less")
        raise ValueError(
            f"no corner up to {corners[-1]:.4g} rad/s loses as little as {100 * loss:g} %: the "
            f"least is {100 * np.nanmin(lost):.3g} %; allow for more loss, or give faster omegas"
        )
    first = kept[0]
    if first == 0:
        return float(corners[0])
    low, high, start = float(corners[first - 1]), float(corners[first]), tried[first].gains
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if keeps(task.tried(middle, start)) else (middle, high)
    return high


def _fastest(task: _Task, corners: Vector, tried: Sequence[_Tried], most: float) -> float:
    """The fastest corner with no more noise, between the corners tried too."""
    kept = [i for i, one in enumerate(tried) if one.noise_gain <= most]
    if not kept:
        raise ValueError(
            f"no corner from {corners[0]:.4g} rad/s has a noise gain of {most:.4g} or less: the "
            f"least is {np.nanmin([one.noise_gain for one in tried]):.4g}; allow for more noise, "
            "give slower omegas, or smaller gains"
        )
    last = kept[-1]
    if last == len(corners) - 1:
        return float(corners[-1])
    low, high, start = float(corners[last]), float(corners[last + 1]), tried[last].gains
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (
            (middle, high) if task.tried(middle, start).noise_gain <= most else (low, middle)
        )
    return low
