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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.validation import increasing, positive
from deadtime.loops import PV, Controller, ControlLoop, DerivativeFilter
from deadtime.tuning._demands import white_to
from deadtime.tuning._exchange import Search
from deadtime.tuning._made import made
from deadtime.tuning._margins import RequiredMargins
from deadtime.tuning._native import noise_gain as noise_gain_of
from deadtime.tuning._objectives import lost, objective_named
from deadtime.tuning._problem import ObjectiveName, Problem, controller_template, pose
from deadtime.tuning._result import FilterChoice
from deadtime.tuning._survey import Survey, surveyed

#: Number of corners tried, and the slowest and fastest in units of 1/(delay + lag + half a sample).
#: Each corner costs a design.
_CORNERS = 11
_SLOWEST, _FASTEST = 2.0, 200.0

#: Bandwidth of the noise of a continuous loop, which has no sampling rate, as a multiple of the
#: fastest corner.
_BEYOND = 10.0

#: Halvings of the interval between two corners: each costs a design and halves the error.
_HALVINGS = 5

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
    level: float = 0.95,
    allow_indication: bool = False,
    threads: int | None = None,
) -> FilterChoice:
    """Choose the corner of the derivative's filter, and the gains with it.

    Parameters
    ----------
    loop : ControlLoop, DelayEstimate or a plant
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
    amplitude, level, allow_indication, threads
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
    problem = pose(
        loop,
        controller_template(controller),
        delay,
        gain,
        fixed,
        ranges,
        amplitude,
        threads,
        level,
        allow_indication,
    )
    goal = objective_named(objective)
    required = RequiredMargins.checked(gain_margin, phase_margin, delay_margin)
    return filter_choice(
        problem, goal, required, shape, loss, noise, command_noise, omegas, damping, bandwidth
    )


def filter_choice(
    problem: Problem,
    objective: ObjectiveName,
    required: RequiredMargins,
    shape: Sequence[int] | None,
    loss: float = 0.1,
    noise: float | None = None,
    command_noise: float | None = None,
    omegas: ArrayLike | None = None,
    damping: float = 1.0,
    bandwidth: float | None = None,
) -> FilterChoice:
    """Design with every corner, and choose."""
    if objective == "overshoot":
        raise ValueError(
            "objective='overshoot': every filter allows an overshoot of zero, so this "
            "objective cannot choose a filter. Choose by 'abscissa', 'damping' or "
            "'settling_time'"
        )
    if noise is None and command_noise is not None:
        raise ValueError(
            "command_noise is given without noise: give the standard deviation of both, of "
            "the command and of the measurement"
        )
    problem = problem.filtered(None)
    if shape is None:
        shape = (_SIDE[len(problem.free)],) * len(problem.free)
    corners = _corners(problem, omegas)
    white = _bandwidth(problem.loop, bandwidth, float(corners[-1]))
    ideal = made(problem, objective, required, shape)
    task = _Task(problem, objective, required, damping, white, surveyed(problem, shape))
    # From the fastest corner down, each from the gains of the one before: they change slowly.
    gains = np.array([ideal.gains[name] for name in problem.free])
    tried: list[_Tried] = []
    for corner in corners[::-1]:
        tried.insert(0, task.tried(float(corner), gains))
        gains = tried[0].gains
    if noise is not None and command_noise is not None:
        most = positive("command_noise", command_noise) / positive("noise", noise)
        rule = f"the fastest filter with a command noise of at most {command_noise:g}"
        omega = _last(task, corners, tried, 1, lambda case: case.noise_gain <= most)
        if omega is None:
            raise _too_noisy(corners, tried, most)
    else:
        loss = positive("loss", loss)
        rule = f"the slowest filter that loses at most {100 * loss:g} %"
        worse = [lost(objective, case.value, ideal.value) for case in tried]
        omega = _last(
            task, corners, tried, -1, lambda case: lost(objective, case.value, ideal.value) <= loss
        )
        if omega is None:
            raise _too_slow(corners, worse, loss)
    chosen = made(task.at(omega), objective, required, shape)
    return FilterChoice(
        omega=omega,
        rule=rule,
        design=chosen,
        ideal=ideal,
        omegas=corners,
        values=np.array([case.value for case in tried]),
        noise_gains=np.array([case.noise_gain for case in tried]),
        value=chosen.value,
        noise_gain=noise_gain(chosen.loop, white),
        ideal_noise_gain=noise_gain(ideal.loop, white),
        bandwidth=white,
        noise=noise,
    )


def noise_gain(loop: ControlLoop, bandwidth: float) -> float:
    """Standard deviation of the command over that of white measurement noise, up to `bandwidth`."""
    return noise_gain_of(loop.specification.kernel, bandwidth)


class _Tried(NamedTuple):
    """The objective, the noise gain and the best gains with one corner."""

    value: float
    noise_gain: float
    gains: Array


@dataclass(frozen=True, eq=False)
class _Task:
    """Everything but the corner."""

    problem: Problem
    objective: ObjectiveName
    required: RequiredMargins
    damping: float
    bandwidth: float
    survey: Survey

    def at(self, corner: float) -> Problem:
        """The problem with one corner of the filter."""
        return self.problem.filtered(DerivativeFilter(corner, self.damping))

    def tried(self, corner: float, start: Array) -> _Tried:
        """Design with one corner from the gains of another; NaN where none meet the margins."""
        problem = self.at(corner)
        alone = len(start) == 1
        try:
            # A map over one gain costs next to nothing.
            shape = self.survey.abscissa.shape
            survey = surveyed(problem, shape) if alone else self.survey
            search = Search(problem, self.objective, survey, self.required)
            found = search.best(None if alone else start)
        except ValueError:
            return _Tried(math.nan, math.nan, start)
        (middle,) = problem.gathered.at([problem.middle])
        noise = noise_gain_of(middle.at(problem.named(found.gains)), self.bandwidth)
        return _Tried(found.value, noise, found.gains)


def _corners(problem: Problem, omegas: ArrayLike | None) -> Array:
    if omegas is not None:
        corners = np.array(increasing("omegas", omegas))
        if corners.size < 2 or corners[0] <= 0.0:
            raise ValueError(
                "omegas: give two or more corner frequencies in rad/s, all above zero and "
                "increasing"
            )
        return corners
    numbers = problem.loop.parameters
    late = problem.intervals["delay"][1] + numbers.get("lag", 0.0)
    late += 0.5 * numbers.get("sample_time", 0.0)
    if late == 0.0:
        raise ValueError(
            "the loop has no delay, lag or sample time from which to choose corner "
            "frequencies: give omegas="
        )
    return np.geomspace(_SLOWEST / late, _FASTEST / late, _CORNERS)


def _bandwidth(loop: ControlLoop, bandwidth: float | None, fastest: float) -> float:
    if bandwidth is None and loop.sample_time is None:
        return _BEYOND * fastest
    return white_to(loop, None if bandwidth is None else positive("bandwidth", bandwidth))


def _too_slow(corners: Array, lost: Sequence[float], loss: float) -> ValueError:
    """Why every corner loses more."""
    if not np.isfinite(lost).any():
        return ValueError("no corner frequency has gains with the required margins: require less")
    return ValueError(
        f"no corner up to {corners[-1]:.4g} rad/s loses as little as {100 * loss:g} %, and the "
        f"smallest loss is {100 * np.nanmin(lost):.3g} %. Allow a larger loss, or give faster "
        "omegas"
    )


def _too_noisy(corners: Array, tried: Sequence[_Tried], most: float) -> ValueError:
    """Why every corner makes more noise."""
    return ValueError(
        f"no corner from {corners[0]:.4g} rad/s on has a noise gain of {most:.4g} or less, and "
        f"the smallest noise gain is {np.nanmin([trial.noise_gain for trial in tried]):.4g}. Allow "
        "more noise, give slower omegas, or smaller gains"
    )


def _last(
    task: _Task,
    corners: Array,
    tried: Sequence[_Tried],
    step: int,
    keeps: Callable[[_Tried], bool],
) -> float | None:
    """The last corner in this direction that keeps to the rule; None where none does.

    It halves the way to the neighbour that does not.
    """
    places = [place for place, trial in enumerate(tried) if keeps(trial)]
    if not places:
        return None
    place = max(places, key=lambda index: step * index)
    kept = float(corners[place])
    if 0 <= place + step < len(corners):
        other = float(corners[place + step])
        for _ in range(_HALVINGS):
            middle = math.sqrt(kept * other)
            is_kept = keeps(task.tried(middle, tried[place].gains))
            kept, other = (middle, other) if is_kept else (kept, middle)
    return kept
