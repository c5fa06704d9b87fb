"""The time from a command of one loop to its response, over the windows of a log.

The time is the equivalent delay -arg G/omega of the plant from the command to the response, at the
frequency at which the response moves: the rate of change of its modelled part over that part, both
as root mean squares. It is what a cross-correlation sees, and so what a pilot feels. Of a plant that
integrates it is that where half of the largest proportional gain crosses over.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from deadtime._base.digits import between as ends_of, stated
from deadtime._base.errors import DeadtimeError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime._base.verdicts import NOT_CLAIMED, Verdict, claimed
from deadtime.estimation import PlantEstimate, estimate_delay, refit
from deadtime.logs.latencies._commands import Command, Sampling
from deadtime.logs.latencies._cost import GainCost, cost_of
from deadtime.logs.latencies._spread import Spread, spread_of
from deadtime.logs.latencies._windows import LENGTHS, LONGEST, Window, best_of, whole_of
from deadtime.recordings import Recording

#: Width of a 95 % interval in standard errors.
TWO_SIDED = 3.92

#: Windows whose time is estimated by themselves, those that move the most: more show more of the
#: spread and take longer.
ALONE = 10

#: Fewest numbers of a plant that a log has to determine: a sine determines two.
TOLD = 3

#: Doubts of an estimate that concern the gain of a loop and not its time, the one about residuals,
#: and the windows that have to agree in its place.
OF_THE_GAIN = ("classes contradict", "crossover not told", "too few told")
NOT_WHITE, MANY = "residuals not white", 5

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
        Equivalent delay from the command to the response at `frequency`, s; NaN if there is none.
    interval : (float, float)
        95 % interval of `time`, s, with the spread between windows.
    frequency : float
        Where the response moves, or where the loop crosses over, rad/s.
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
    """

    loop: str
    axis: str
    kind: str
    command: Command
    verdict: Verdict
    reason: str
    time: float = math.nan
    interval: tuple[float, float] = (math.nan, math.nan)
    frequency: float = math.nan
    windows: tuple[tuple[float, float], ...] = ()
    estimate: PlantEstimate | None = None
    times: tuple[WindowTime, ...] = ()
    spread: Spread | None = None
    cost: GainCost | None = None
    sampling: Sampling | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """Such as ``"roll rate, setpoint to response"``."""
        return f"{self.loop}, {self.command} to response"

    @property
    def stderr(self) -> float:
        """The standard error that the interval amounts to, s."""
        return (self.interval[1] - self.interval[0]) / TWO_SIDED

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
        value = claimed(self.verdict, self.time, self.stderr, "s")
        if self.verdict != "reliable":
            return value
        return f"{value} (95 %: {ends_of(*self.interval, self.stderr, 's')})"

    def to_dict(self) -> dict[str, Any]:
        """The time as plain values for JSON."""
        names = (
            "loop", "axis", "kind", "command", "verdict", "reason", "time", "frequency", "windows"
        )  # fmt: skip
        parts = {
            name: None if part is None else part.to_dict()
            for name, part in (
                ("estimate", self.estimate), ("spread", self.spread), ("cost", self.cost)
            )
        }  # fmt: skip
        known = {"interval_95": self.interval if self.verdict == "reliable" else None}
        each = {"times": [vars(one) for one in self.times]}
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
    chosen = best_of(windows)
    if not windows:
        return replace(nothing, reason="it is never followed for long enough")
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
    found = _with_interval(found, windows)
    if why := _no_answer(found):
        return replace(found, verdict="none", reason=why, estimate=None)
    if why := _why_doubtful(found):
        found = found.doubted(why)
    cost = cost_of(fit, fit.recording) if found.command == "actuator" else None
    return replace(found, cost=cost)


def _fitted(
    parts: Sequence[Recording], kind: str, integrates: bool | None, sampling: Sampling | None
) -> PlantEstimate:
    """The likeliest plant over all parts together."""
    length = float(min(one.time[-1] - one.time[0] for one in parts))
    longest = LONGEST * min(LENGTHS.get(kind, length), length)
    known: dict[str, Any] = {}
    if sampling is not None:
        known = {"between": sampling.between, "hold": sampling.hold or None}
    return estimate_delay(
        parts,
        closed_loop=integrates,
        integrates=integrates,
        largest_delay=longest,
        **known,
    )


def _with_interval(found: LoopLatency, windows: Sequence[Window]) -> LoopLatency:
    """The time with its interval: that of the fit, the spread, and what the log leaves unknown."""
    fit = found.estimate
    assert fit is not None
    omega = _frequency_of(fit)
    times = _alone(fit, windows, omega)
    spread = None
    value, low, high = _time_at(fit, omega)
    if len(times) > 1:
        spread = spread_of(*np.array([(t.time, t.stderr, t.movement) for t in times]).T)
        fitted = sum(_is_in(one.at, found.windows) for one in times)
        between = _reach(spread) / math.sqrt(max(1, fitted))
        low = value - math.hypot(value - low, between)
        high = value + math.hypot(high - value, between)
        if fit._code == NOT_WHITE:
            low, high = min(low, spread.interval[0]), max(high, spread.interval[1])
    unsure = 0.0 if found.sampling is None else found.sampling.unsure
    interval = (max(0.0, low - unsure), high + unsure)
    return replace(
        found, time=value, interval=interval, frequency=omega, times=times, spread=spread
    )


def _why_doubtful(found: LoopLatency) -> str:
    """Why the interval may not hold the time; empty where it is claimed to.

    It is over all kinds of plant that explain the log alike, so that these need not agree where a
    loop would cross over. Windows that agree stand for a noise that the model does not know.
    """
    fit = found.estimate
    assert fit is not None
    if fit.verdict == "reliable" or fit._code in OF_THE_GAIN:
        return ""
    many = found.spread is not None and found.spread.count >= MANY
    return "" if fit._code == NOT_WHITE and many else fit.reason


def _is_in(time: float, windows: Sequence[tuple[float, float]]) -> bool:
    return any(start <= time <= stop for start, stop in windows)


def _reach(spread: Spread) -> float:
    """How far the true time of one window may lie from the mean, s, at 95 %."""
    from scipy.special import stdtrit

    return spread.between * float(stdtrit(spread.count - 1, 0.975))


def _frequency_of(fit: PlantEstimate) -> float:
    """The frequency at which the time is told, rad/s."""
    if fit.best.integrates and math.isfinite(fit.crossover):
        return fit.crossover
    moves = rates = 0.0
    for run in fit.runs:
        known = np.isfinite(run.fitted)
        time, values = run.recording.time[known], run.fitted[known]
        line = np.polynomial.Polynomial.fit(time, values, 1)
        moves += float(np.sum((values - line(time)) ** 2))
        rates += float(np.sum(np.gradient(values, time) ** 2))
    return math.sqrt(rates / moves) if moves > 0.0 else math.nan


def _time_at(fit: PlantEstimate, omega: float) -> tuple[float, float, float]:
    """The equivalent delay at a frequency, and its 95 % interval, s."""
    seen = fit.at([omega])
    low, high = seen.delay_ci[:, 0].tolist()
    return float(seen.delay[0]), low, high


def _alone(fit: PlantEstimate, windows: Sequence[Window], omega: float) -> tuple[WindowTime, ...]:
    """The time of each window by itself, where it tells one."""
    moving = sorted(windows, key=lambda one: one.movement, reverse=True)[:ALONE]
    found = []
    for one in sorted(moving, key=lambda one: one.start):
        try:
            alone = refit(fit, [one.recording])
        except (DeadtimeError, ValueError):
            continue
        if not alone.candidates or alone.best.parameters["gain"] <= 0.0:
            continue
        value, low, high = _time_at(alone, omega)
        error = (high - low) / TWO_SIDED
        if _says_something(value, error, one.recording):
            middle = 0.5 * (one.start + one.stop)
            found.append(WindowTime(middle, value, error, one.movement))
    return tuple(found)


def _says_something(value: float, error: float, part: Recording) -> bool:
    return math.isfinite(error) and error < max(value, OF_A_ROW * part.sample_time)


def _no_answer(found: LoopLatency) -> str:
    """Why the fit is no answer of a vehicle to this command; empty if it may be one."""
    fit = found.estimate
    assert fit is not None
    if fit.best.parameters["gain"] <= 0.0:
        return f"the response moves against its command (gain {fit.best.parameters['gain']:.3g})"
    if not (found.time > 0.0 and _says_something(found.time, found.stderr, fit.recording)):
        value = stated(found.time, found.stderr, "s")
        return f"the time comes out as {value}: that says nothing"
    return ""
