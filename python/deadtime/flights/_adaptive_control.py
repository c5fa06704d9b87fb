"""Control of one axis with gains that follow the delay, sample by sample, during a flight."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from deadtime.estimation import OnlineEstimator
from deadtime.flights._axis_control import AxisControl
from deadtime.links.clock import now
from deadtime.loops import PAPER_FILTER, PV, P, RateLimited
from deadtime.tuning import GainSchedule

#: Commands that are kept to shape the newest one: it takes a few seconds to follow any.
KEPT = 150

#: Columns of the choices of a flight.
CHOICE = ("time_s", "low_s", "high_s", "set", "covered")


class ChosenSet(NamedTuple):
    """What was known of the delay at one sample, and the set that was used."""

    time: float
    low: float
    high: float
    number: int
    covered: bool


class ScheduledControl(AxisControl):
    """The command with the robust gains of a schedule.

    Parameters
    ----------
    schedule : GainSchedule
        The proved gains.
    """

    def __init__(self, schedule: GainSchedule) -> None:
        controller = schedule.loop.controller
        if not isinstance(controller, (P, PV)):
            raise TypeError(f"controller={controller!r}: give a schedule of gains for P or PV")
        smoothing = getattr(controller, "filter", None)
        super().__init__(controller, schedule.proof.sample_time, smoothing or PAPER_FILTER)
        self._filtered = smoothing is not None

    def command(self, reference: float, output: float, rate: float | None) -> float:
        """The commanded rate; `rate` is used where the proof is without a filter."""
        return super().command(reference, output, None if self._filtered else rate)


class AdaptiveControl(ScheduledControl):
    """The command with the gains that the delay permits, which is estimated during the flight.

    Parameters
    ----------
    schedule : GainSchedule
        The proved gains.
    estimator : OnlineEstimator
        Of the loop's delay, without rows yet; it is told of every output and command.
    limit : float
        Largest command.
    shaping : RateLimited, optional
        The limits within which the vehicle follows its commands; the plant of the estimator is what
        comes after them.

    Attributes
    ----------
    choices : list of ChosenSet
        One for each sample.
    """

    def __init__(
        self,
        schedule: GainSchedule,
        estimator: OnlineEstimator,
        limit: float,
        shaping: RateLimited | None = None,
    ) -> None:
        super().__init__(schedule)
        self._schedule, self._estimator, self._limit = schedule, estimator, limit
        self._shaping = shaping
        self._sent: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self._follower = schedule.follow()
        self.choices: list[ChosenSet] = []

    def command(self, reference: float, output: float, rate: float | None) -> float:
        """The commanded rate with the gains of now."""
        time = now()
        self._tell(time)
        known = self._estimator.update(time, output)
        low, high = known.ci
        choice = self._follower.update(time, low, high, known.verdict == "reliable")
        self.choices.append(ChosenSet(time, low, high, choice.number, choice.covered))
        command = super().command(reference, output, rate)
        command *= self._schedule.sets[choice.number].factor
        self._sent.append((time, max(-self._limit, min(self._limit, command))))
        return command

    def _tell(self, time: float) -> None:
        """Tell the estimator of the last command, as the vehicle followed it until now."""
        if not self._sent:
            return
        if self._shaping is None:
            self._estimator.command(*self._sent[-1])
            return
        # At rest at the first command that is kept: what that differs by has faded since.
        times, commands = np.array([*self._sent, (time, self._sent[-1][1])]).T
        pieces = zip(*self._shaping.limited(times, commands), strict=True)
        for begin, value in pieces:
            if times[-2] <= begin < time:
                self._estimator.command(float(begin), float(value))
