"""The time from a command of one loop to its response, estimated over its best windows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from deadtime._base.digits import between, stated
from deadtime._base.errors import DeadtimeError, NotIdentifiableError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.plain import plain_fields
from deadtime._base.verdicts import NOT_CLAIMED, claimed
from deadtime.estimation import (
    DelayEstimate,
    OutputError,
    bic,
    estimate_delay,
    likeliest,
    with_pair,
)
from deadtime.logs.latencies._clocks import Stamped, why_two_clocks
from deadtime.logs.latencies._controller import Between, Command
from deadtime.logs.latencies._cost import GainCost, cost_of
from deadtime.logs.latencies._elsewhere import TWO_SIDED, contradiction
from deadtime.logs.latencies._windows import LONGEST, OF_A_ROW, Window
from deadtime.loops import ControlLoop, FactoredPlant, P
from deadtime.recordings import Recording

#: The second lag that is tried, as a share of the first.
SECOND = 0.3

#: Difference of BIC at which commands hold, or move, between rows, and what it may be worth
#: otherwise, as a share of the 95 % interval.
CLEARLY, WORTH = 6.0, 0.25

#: What an estimate says whose plant has too few lags, and one whose windows differ.
LACKING, CONTRADICT = "a further lag of", "the recordings contradict one another"

#: Intervals of the other numbers are computed when they are asked for.
METHOD = OutputError(intervals="sum", rivals=False)


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
    windows : tuple of (float, float)
        Where it was estimated, s from the start of the log, the one that promises most first.
    promise : float
        Standard error of delay and lag together that the first window promises, s.
    estimate : DelayEstimate or None
        Gain, delay and one or two lags, or a pair of complex poles, over all windows together; None
        where it was refused.
    refusal : str
        Why there is no estimate; empty where there is one.
    cost : GainCost or None
        Gains of a proportional controller for the estimated vehicle.
    between : {"held", "lines"} or None
        Whether commands are known to hold between the rows of the log, or to move.
    """

    loop: str
    axis: str
    kind: str
    command: Command
    windows: tuple[tuple[float, float], ...]
    promise: float
    estimate: DelayEstimate | None
    refusal: str = ""
    cost: GainCost | None = None
    between: Between | None = None

    @property
    def name(self) -> str:
        """Such as ``"roll rate, setpoint to response"``."""
        return f"{self.loop}, {self.command} to response"

    def sum_of(self) -> tuple[float, float, tuple[float, float]]:
        """Delay and lag together, the error that its interval amounts to, and that, s.

        The interval is the 95 % one; the error a standard error, (high - low)/3.92.
        """
        if self.estimate is None:
            raise ValueError(f"{self.name} was refused: {self.refusal}")
        low, high = self.estimate.ci(0.95, "delay+lag")
        return self.estimate.delay_plus_lag, (high - low) / (2.0 * TWO_SIDED), (low, high)

    def headline(self) -> str:
        """The time in one line."""
        if self.estimate is None:
            return f"none: {self.name}, {self.refusal}"
        value, error, (low, high) = self.sum_of()
        verdict = self.estimate.verdict
        known = f"{verdict}: {self.name} {claimed(verdict, value, error, 's')}"
        if verdict != "reliable":
            return f"{known}, {NOT_CLAIMED}"
        return f"{known} (95 %: {between(low, high, error, 's')})"

    def to_dict(self) -> dict[str, Any]:
        """The time as plain values for JSON.

        Of the numbers of the estimate, only delay and lag together have an interval besides their
        standard errors: `estimate` has the others, and some take long.
        """
        fit = self.estimate
        names = ("loop", "axis", "kind", "command", "windows", "promise", "refusal")
        results = {
            "estimate": None if fit is None else fit.to_dict(intervals=("delay+lag",)),
            "cost": None if self.cost is None else self.cost.to_dict(),
        }
        return plain_fields({name: getattr(self, name) for name in names} | results)


def relation_of(
    loop: str,
    axis: str,
    kind: str,
    command: Command,
    windows: list[Window],
    between: Between | None = None,
    held: Callable[[Window], Recording] | None = None,
    hidden: float = 0.0,
    unsure: float = 0.0,
    others: Sequence[Window] = (),
) -> LoopLatency:
    """Fit the plant of a loop to its windows, or say why that tells nothing.

    Where it is not known whether commands hold or move between rows, `held` gives a window with
    commands that hold; the likelier of the two is taken. A time below `hidden`, s, is not reliable,
    nor one whose interval is narrow against `unsure`, s, by which commands may hold longer or less,
    nor one that `others` contradict.
    """
    ends = _ends_of(windows)
    told = [one for one in windows if one.tells]
    promise = windows[0].promise if windows else float("inf")

    def refused(why: str) -> LoopLatency:
        return LoopLatency(loop, axis, kind, command, ends, promise, None, why)

    if not windows:
        return refused("it is never followed for long enough")
    if not told:
        return refused(_says_nothing(windows[0], command))
    try:
        fit = _fitted(told, command == "actuator", held, others)
    except DeadtimeError as error:
        return refused(str(error).partition("; check ")[0])
    if why := _no_answer(fit, told[0]):
        return refused(why)
    if fit.delay_plus_lag < hidden:
        fit = fit.doubted(
            f"the {command} moves between rows of the log by more than it shows, which hides times "
            f"below {stated(hidden, 0.0, 's')}",
        )
    low, high = fit.ci(0.95, "delay+lag")
    if unsure > WORTH * (high - low):
        fit = fit.doubted(
            "the log does not tell when commands changed between its rows, or how long each holds, "
            f"which is worth {stated(unsure, 0.0, 's')} more or less",
        )
    cost = cost_of(fit, told[0].recording) if command == "actuator" else None
    ends = _ends_of(told[: len(fit.runs)])
    return LoopLatency(loop, axis, kind, command, ends, promise, fit, "", cost, between)


def doubted_by_clocks(
    found: LoopLatency, seen: list[Window], command: Stamped, response: Stamped
) -> LoopLatency:
    """The time as an indication, where both signals are stamped by clocks of their own.

    `seen` are all windows that tell something, `command` and `response` names and stamps, s.
    """
    if found.estimate is None:
        return found
    why = why_two_clocks(found.estimate, seen, command, response)
    return replace(found, estimate=found.estimate.doubted(why)) if why else found


def _ends_of(windows: list[Window]) -> tuple[tuple[float, float], ...]:
    """Start and stop of each window, s."""
    return tuple((one.start, one.stop) for one in windows)


def _no_answer(fit: DelayEstimate, window: Window) -> str:
    """Why the fit is no answer of a vehicle to this command; empty if it may be one."""
    # The interval: two lags that come out equal have no finite standard error.
    low, high = fit.ci(0.95, "delay+lag")
    value, error = fit.delay_plus_lag, (high - low) / (2.0 * TWO_SIDED)
    if fit.gain is not None and fit.gain <= 0.0:
        return f"the response moves against its command (gain {fit.gain:.3g})"
    longest = LONGEST * (window.stop - window.start)
    if value > longest:
        return (
            f"delay and lag together come out as {stated(value, error, 's')}, longer than the "
            f"{longest:.3g} s that a window of {window.stop - window.start:.3g} s can tell"
        )
    if not np.isfinite(error) or error > max(value, OF_A_ROW * window.recording.sample_time):
        return f"delay and lag together come out as {stated(value, error, 's')}: that says nothing"
    return ""


def _says_nothing(window: Window, command: str) -> str:
    """Why the best window of a loop says nothing."""
    if not np.isfinite(window.promise):
        return f"the {command} does not move"
    share = f"{100.0 * window.explained:.0f} % of the response follows the {command}"
    promise = stated(window.time, window.promise, "s")
    return f"too little moves: even in the best window {share}, which promises {promise}"


def _fitted(
    windows: list[Window],
    integrates: bool,
    held: Callable[[Window], Recording] | None,
    others: Sequence[Window],
) -> DelayEstimate:
    """The plant that fits all windows, or the first of them where they contradict one another."""
    first = max(0.5 * windows[0].time, windows[0].recording.sample_time)

    def lagging(*lags: float) -> FactoredPlant:
        return FactoredPlant(lags, integrator=integrates)

    def tried(parts: list[Recording], plant: FactoredPlant) -> DelayEstimate:
        names = ["delay", *(name for name in plant.parameters if name != "zero")]
        loop = ControlLoop(plant, P(1.0))
        return estimate_delay(parts, loop, method=METHOD, free=names)

    def richer(parts: list[Recording], fit: DelayEstimate) -> DelayEstimate:
        """The fit, or that with two lags, or a pair of poles, where one lag is not enough."""
        if fit.verdict == "reliable" or LACKING not in fit.message:
            return fit
        found = {"1 lag": fit}
        try:
            found["2 lags"] = more = tried(parts, lagging(first, SECOND * first))
            # A loop that is closed around a lag is of second order, and mostly oscillates.
            if not (integrates or more.verdict == "reliable") and LACKING in more.message:
                pair = with_pair(cast(FactoredPlant, more.loop.plant))
                complex_poles = None if pair is None else tried(parts, pair)
                # Noise takes the place of what a pair lacks, which least squares tells better.
                if complex_poles is not None and complex_poles.verdict == "reliable":
                    return complex_poles
        except NotIdentifiableError:
            pass
        return found[likeliest(found)]

    parts, beside = ([one.recording for one in some] for some in (windows, others))
    fit, doubt = tried(parts[:1], lagging(first)), ""
    if held is not None:
        still = tried([held(windows[0])], lagging(first))
        better = bic(fit) - bic(still)
        if abs(better) < CLEARLY:
            doubt = _either(fit, still)
        if better > 0.0:
            fit = still
            parts, beside = ([held(one) for one in some] for some in (windows, others))
    if doubt:
        return fit.doubted(doubt)
    fit = richer(parts[:1], fit)
    # What the plant lacks in one window it lacks in all together.
    if len(parts) > 1 and fit.verdict == "reliable":
        try:
            together = tried(parts, cast(FactoredPlant, fit.loop.plant))
        except NotIdentifiableError:
            return fit
        reasons = together.reason.split("; ")
        apart = [one.replace("recordings", "windows") for one in reasons if CONTRADICT in one]
        fit = fit.doubted("; ".join(apart)) if apart else richer(parts, together)
    if fit.verdict == "reliable" and (why := contradiction(fit, beside, METHOD)):
        return fit.doubted(why)
    return fit


def _either(moving: DelayEstimate, still: DelayEstimate) -> str:
    """What it is worth that commands hold or move between rows; empty if next to nothing."""
    apart = abs(moving.delay_plus_lag - still.delay_plus_lag)
    low, high = moving.ci(0.95, "delay+lag")
    if apart < WORTH * (high - low):
        return ""
    return (
        "the log does not tell whether commands hold or move between its rows, which is worth "
        f"{stated(apart, 0.0, 's')}"
    )
