"""The time from a command of one loop to its response, over the windows of a log.

The time is the equivalent delay -arg G/omega of the plant from the command to the response, in the
mean over the frequencies at which the response moves: each has the power of the rate of change of
the modelled response as its weight. So weighs a cross-correlation, and so does a pilot. Of a plant
that integrates it is the equivalent delay where half of the largest proportional gain crosses over.

Where windows differ by more than their errors, the time is the mean over the windows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import between as ends_of, shown, stated
from deadtime._base.errors import DeadtimeError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime._base.verdicts import NOT_CLAIMED, Verdict, claimed, rough
from deadtime.estimation import PlantEstimate, estimate_delay, refit
from deadtime.logs.latencies._commands import Command, Sampling
from deadtime.logs.latencies._cost import GainCost, cost_of
from deadtime.logs.latencies._moves import Moves
from deadtime.logs.latencies._plain import Difference, PlainTimes
from deadtime.logs.latencies._spread import Spread, spread_of
from deadtime.logs.latencies._windows import (
    FEWEST,
    LENGTHS,
    LONGEST,
    Window,
    best_of,
    grouped,
    that_follow,
    whole_of,
)
from deadtime.recordings import Recording

#: Width of a 95 % interval in standard errors.
TWO_SIDED = 3.92

#: Windows whose time is estimated by themselves, those that move the most: more show more of the
#: spread and take longer.
ALONE = 10

#: Fewest numbers of a plant that a log has to determine: a sine determines two.
TOLD = 3

#: Doubts of an estimate that concern the gain of a loop and not its time, and that of residuals.
OF_THE_GAIN = ("classes contradict", "crossover not told", "too few told")
NOT_WHITE = "residuals not white"

#: Fewest windows that show a time by themselves, and those that have to where the noise of the fit
#: is not known: more claim less of short flights.
FEW, MANY = 4, 8

#: Probability below which what a fit leaves is not white.
WHITE = 1e-3

#: Bands of frequency over which the time is averaged: more see more of its change and take longer.
BANDS = 24

#: Share of the power below which a band is left out.
NEGLIGIBLE = 1e-3

#: Probability of the scatter of windows below which they differ.
DIFFER = 0.05

#: A time says something if its standard error is below itself, or below so many rows.
OF_A_ROW = 2.0


@dataclass(frozen=True)
class WindowTime:
    """The time of one window, estimated by itself.

    Attributes
    ----------
    at : float
        Middle of the window, s from the start of the log.
    time, stderr : float
        From the command to the response, and its standard error, s.
    movement : float
        Deviation of the command from a straight line.
    """

    at: float
    time: float
    stderr: float
    movement: float


@dataclass(frozen=True, eq=False)
class LoopLatency(ReadOnlyArrays):
    """The time from a command of one loop to its response.

    Attributes
    ----------
    loop, axis, kind : str
        The loop, as in the log.
    command : {"setpoint", "actuator"}
        From what the time counts: the setpoint, with the loop closed, or what its controller
        commands, which is the vehicle alone.
    verdict : {"reliable", "indication", "none"}
        Whether `interval` is claimed to hold; whether there is a time at all.
    reason : str
        Why it is not ``"reliable"``; empty where it is.
    time : float
        From the command to the response, s: its mean equivalent delay; NaN if there is none.
    interval : (float, float)
        95 % interval of `time`, s, with the spread between windows.
    frequencies, weights : ndarray, shape (n,)
        Where the response moves, rad/s, and the weight of each, which add up to one.
    windows : tuple of (float, float)
        Where it was estimated, s from the start of the log.
    estimate : PlantEstimate or None
        The plant that the windows show together; None where there is no time.
    times : tuple of WindowTime
        The time of each window by itself.
    spread : Spread or None
        What these say together; None of fewer than two.
    cost : GainCost or None
        Gains of a proportional controller for the estimated vehicle.
    sampling : Sampling or None
        How commands pass between the rows of the log.
    plain : PlainTimes or None
        The plain numbers of the field, from the setpoint.
    differences : tuple of Difference
        These less what the same methods give for the fit.
    answered : Moves or None
        The moves of the setpoint with the response of the fit.
    """

    loop: str
    axis: str
    kind: str
    command: Command
    verdict: Verdict
    reason: str
    time: float = math.nan
    interval: tuple[float, float] = (math.nan, math.nan)
    frequencies: Array = field(default_factory=lambda: np.empty(0), repr=False)
    weights: Array = field(default_factory=lambda: np.empty(0), repr=False)
    windows: tuple[tuple[float, float], ...] = ()
    estimate: PlantEstimate | None = None
    times: tuple[WindowTime, ...] = ()
    spread: Spread | None = None
    cost: GainCost | None = None
    sampling: Sampling | None = field(default=None, repr=False)
    plain: PlainTimes | None = None
    differences: tuple[Difference, ...] = ()
    answered: Moves | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """Such as ``"roll rate, setpoint to response"``."""
        return f"{self.loop}, {self.command} to response"

    @property
    def stderr(self) -> float:
        """The standard error that the interval amounts to, s."""
        return (self.interval[1] - self.interval[0]) / TWO_SIDED

    @property
    def is_bound(self) -> bool:
        """Whether the interval begins at zero, so that only its upper end says something."""
        return self.verdict == "reliable" and self.interval[0] <= 0.0

    def doubted(self, why: str) -> LoopLatency:
        """The time as an indication, for this reason too."""
        reason = f"{self.reason}; {why}" if self.reason else why
        return replace(self, verdict="indication", reason=reason)

    def headline(self) -> str:
        """The time in one line."""
        if self.verdict == "none":
            return f"none: {self.name}, {self.reason}"
        known = f"{self.verdict}: {self.name} {self.shown()}"
        return known if self.verdict == "reliable" else f"{known}, {NOT_CLAIMED}"

    def shown(self) -> str:
        """The time with its interval where that is claimed to hold."""
        if self.verdict == "none":
            return "—"
        if self.is_bound:
            return f"{self.bound()} (95 %)"
        value = claimed(self.verdict, self.time, self.stderr, "s")
        if self.verdict != "reliable":
            return value
        return f"{value} (95 %: {ends_of(*self.interval, self.stderr, 's')})"

    def bound(self) -> str:
        """The upper end of the interval: "below 90 ms"."""
        return f"below {shown(self.interval[1], self.stderr, 's')}"

    def to_dict(self) -> dict[str, Any]:
        """The time as plain values for JSON."""
        names = ("loop", "axis", "kind", "command", "verdict", "reason", "time", "windows")
        parts = {
            name: None if part is None else part.to_dict()
            for name, part in (
                ("estimate", self.estimate), ("spread", self.spread), ("cost", self.cost),
                ("plain", self.plain),
            )
        }  # fmt: skip
        known = {"interval_95": self.interval if self.verdict == "reliable" else None}
        each = {"times": [vars(window) for window in self.times]}
        return plain_fields({name: getattr(self, name) for name in names} | known | each | parts)


def relation_of(
    nothing: LoopLatency,
    windows: Sequence[Window],
    part: Callable[[float, float], Recording],
    sampling: Sampling | None = None,
    integrates: bool | None = None,
) -> LoopLatency:
    """The plant of a loop over its windows, or why they do not show one.

    `nothing` is the loop without a time, `part` gives the recording from one time to another, s, as
    it is fitted, `sampling` how its commands pass between rows then.
    """
    if not windows:
        return replace(nothing, reason="the response never follows its setpoint for long enough")
    windows = that_follow(windows)
    chosen = best_of(windows)
    if not chosen:
        return replace(nothing, reason=f"the {nothing.command} does not move")
    try:
        fit = _fitted([part(*ends) for ends in chosen], nothing.kind, integrates, sampling)
        if fit.verdict == "none" and fit.determined < TOLD:
            return replace(nothing, reason=fit.reason)
        fit = refit(fit, [part(*ends) for ends in whole_of(windows)])
    except (DeadtimeError, ValueError) as error:
        return replace(nothing, reason=str(error).partition("; ")[0])
    found = replace(nothing, verdict="reliable", windows=tuple(chosen), estimate=fit)
    found = _with_interval(found, windows, part)
    if why := _no_answer(found):
        return replace(nothing, reason=why, windows=found.windows, times=found.times)
    if why := _why_doubtful(found):
        found = found.doubted(why)
    cost = cost_of(fit, fit.recording) if found.command == "actuator" else None
    return replace(found, cost=cost)


def _fitted(
    parts: Sequence[Recording], kind: str, integrates: bool | None, sampling: Sampling | None
) -> PlantEstimate:
    """The likeliest plant over all parts together."""
    length = float(min(part.time[-1] - part.time[0] for part in parts))
    longest = LONGEST * min(LENGTHS.get(kind, length), length)
    known: dict[str, Any] = {}
    if sampling is not None:
        known = {"between": sampling.between, "hold": sampling.hold or None}
    return estimate_delay(
        parts,
        closed_loop=integrates,
        integrates=integrates,
        causes=False,
        largest_delay=longest,
        **known,
    )


def _with_interval(
    found: LoopLatency, windows: Sequence[Window], part: Callable[[float, float], Recording]
) -> LoopLatency:
    """The time with its interval: that of the fit, the spread, and what the log leaves unknown."""
    fit = found.estimate
    assert fit is not None
    crossover = fit.best.integrates and math.isfinite(fit.crossover)
    where = _moving_frequencies(fit, crossover)
    value, (low, high) = fit.mean_delay(*where)
    times = _alone(fit, windows, part, value, crossover)
    spread = None
    if len(times) > 1:
        spread = spread_of(*np.array([(t.time, t.stderr, t.movement) for t in times]).T)
        if spread.p_value < DIFFER:
            # The spread does not show what kinds of plant differ by: no less than that is claimed.
            below, above = value - low, high - value
            value, (low, high) = spread.mean, spread.interval
            low, high = min(low, value - below), max(high, value + above)
        if _is_coloured(fit):
            low, high = min(low, spread.interval[0]), max(high, spread.interval[1])
    unsure = 0.0 if found.sampling is None else found.sampling.unsure
    interval = (max(0.0, low - unsure), high + unsure)
    return replace(
        found, time=value, interval=interval, times=times, spread=spread,
        frequencies=where.omega, weights=where.weight,
    )  # fmt: skip


def _why_doubtful(found: LoopLatency) -> str:
    """Why the interval may not hold the time; empty where it is claimed to.

    It is over all kinds of plant that explain the log alike, so that these need not agree where a
    loop would cross over. Windows that agree stand for a noise that the model does not know.
    """
    fit = found.estimate
    assert fit is not None
    needed = MANY if _is_coloured(fit) else FEW
    if len(found.times) < needed:
        return (
            f"a time needs {needed} windows that determine the time alone, but there are only "
            f"{len(found.times)}"
        )
    return "" if fit.verdict == "reliable" or fit._code in (*OF_THE_GAIN, NOT_WHITE) else fit.reason


def _is_coloured(fit: PlantEstimate) -> bool:
    """Whether the fit leaves a noise that is none of those that are known."""
    return fit._answer().candidates[0].whiteness < WHITE


class Frequencies(NamedTuple):
    """Frequencies, rad/s, and their weights, which add up to one."""

    omega: Array
    weight: Array


def _moving_frequencies(fit: PlantEstimate, crossover: bool) -> Frequencies:
    """Where the modelled response moves, in bands, or where a loop crosses over."""
    if crossover:
        return Frequencies(np.array([fit.crossover]), np.ones(1))
    longest = max(run.recording.time[-1] - run.recording.time[0] for run in fit.runs)
    step = min(run.recording.sample_time for run in fit.runs)
    edges = np.geomspace(2.0 * math.pi / longest, math.pi / step, BANDS + 1)
    power = np.zeros(BANDS)
    moment = np.zeros(BANDS)
    for run in fit.runs:
        known = np.isfinite(run.fitted)
        time, values = run.recording.time[known], run.fitted[known]
        even = np.arange(time[0], time[-1], step)
        rate = np.diff(np.interp(even, time, values))
        spectrum = np.abs(np.fft.rfft(rate * np.hanning(rate.size))) ** 2
        omega = 2.0 * math.pi * np.fft.rfftfreq(rate.size, step)
        power += np.histogram(omega, edges, weights=spectrum)[0]
        moment += np.histogram(omega, edges, weights=spectrum * omega)[0]
    some = power > NEGLIGIBLE * power.sum()
    weight = power[some] / power[some].sum()
    return Frequencies(moment[some] / power[some], weight)


def _alone(
    fit: PlantEstimate,
    windows: Sequence[Window],
    part: Callable[[float, float], Recording],
    time: float,
    crossover: bool,
) -> tuple[WindowTime, ...]:
    """The time of each window by itself, or of some neighbours together, where it tells one.

    A window moves at frequencies of its own: there its delay is compared with that of the whole.
    """
    found = []
    for start, stop, movement in _places(windows):
        try:
            rows = part(start, stop)
            alone = refit(fit, [rows], likeliest=True)
        except (DeadtimeError, ValueError):
            continue
        if not alone.candidates or alone.best.parameters["gain"] <= 0.0:
            continue
        where = _moving_frequencies(fit if crossover else alone, crossover)
        if not where.omega.size:
            continue
        value, (low, high) = alone.mean_delay(*where)
        value += time - fit.mean_delay(*where)[0]
        error = (high - low) / TWO_SIDED
        if _says_something(value, error, rows):
            found.append(WindowTime(0.5 * (start + stop), value, error, movement))
    return tuple(found)


def _places(windows: Sequence[Window]) -> list[tuple[float, float, float]]:
    """Where the time is estimated by itself, in order: start, stop, s, and movement.

    In groups of windows where they are many, and in parts of them where they are few.
    """
    moving = sorted(grouped(windows, ALONE), key=_movement, reverse=True)[:ALONE]
    found = []
    for some in sorted(moving, key=lambda some: some[0].start):
        rows = sum(len(window.recording) for window in some)
        count = max(1, min(-(-FEW // len(moving)), rows // (2 * FEWEST)))
        edges = np.linspace(some[0].start, some[-1].stop, count + 1).tolist()
        found += [(start, stop, _movement(some)) for start, stop in pairwise(edges)]
    return found


def _movement(windows: Sequence[Window]) -> float:
    """That of windows together."""
    return math.sqrt(sum(window.movement**2 for window in windows) / len(windows))


def _says_something(value: float, error: float, part: Recording) -> bool:
    return math.isfinite(error) and error < max(value, OF_A_ROW * part.sample_time)


def _no_answer(found: LoopLatency) -> str:
    """Why the fit is no answer of a vehicle to this command; empty if it may be one."""
    fit = found.estimate
    assert fit is not None
    if fit.best.parameters["gain"] <= 0.0:
        return (
            "the response moves in the opposite direction of its command (gain "
            f"{fit.best.parameters['gain']:.3g})"
        )
    if found.interval[1] <= 0.0 or found.time <= 0.0:
        ahead = rough(-found.time, "s")
        return f"the response comes {ahead} before its command, so it follows something else"
    if fit.verdict == "none" and len(found.times) < FEW:
        # Only windows that agree show the time of a plant which the log does not determine.
        return fit.reason
    if not _says_something(found.time, found.stderr, fit.recording):
        value = stated(found.time, found.stderr, "s")
        return f"the estimated time, {value}, is too uncertain"
    return ""
