"""The choice of a set of gains from the interval of the delay, with hysteresis and dwell time."""

from __future__ import annotations

import math
from typing import NamedTuple

from deadtime._base.validation import non_negative


class Choice(NamedTuple):
    """Which set is in use.

    Attributes
    ----------
    number : int
        Of the schedule's `sets`; the last one holds the robust gains.
    covered : bool
        Whether the interval of the delay lies in that of the set, so that the proof applies. Where
        it does not, or the delay is not known, the robust gains are in use.
    """

    number: int
    covered: bool


class GainFollower:
    """Chooses the fastest set that the interval of the delay permits.

    Made by `GainSchedule.follow`. A set is left at once when the interval of the delay is no longer
    inside that of the set. A faster one is taken when the interval has been inside its own, with
    room to spare, for the dwell time. Without an interval the robust gains are in use.

    Attributes
    ----------
    choice : Choice
        The set in use; the robust one at first.
    """

    def __init__(
        self,
        delays: tuple[tuple[float, float], ...],
        sample_time: float,
        *,
        dwell: float,
        hysteresis: float,
        rate: float,
    ) -> None:
        self.delays = delays
        self.sample_time = sample_time
        self.dwell = non_negative("dwell", dwell)
        self.hysteresis = non_negative("hysteresis", hysteresis)
        self.rate = non_negative("rate", rate)
        self.choice = Choice(len(delays) - 1, False)
        self._inside_since = [math.inf] * len(delays)
        self._time = -math.inf

    def update(self, time: float, low: float, high: float, informed: bool = True) -> Choice:
        """Choose a set for the command that is computed now.

        Parameters
        ----------
        time : float
            s, not before that of the last call.
        low, high : float
            Interval of the delay, s. Give one of high probability: the proof holds where the delay
            is inside.
        informed : bool
            Whether the interval is a measured one.

        Returns
        -------
        Choice

        Raises
        ------
        ValueError
            If time runs back or is not finite.

        Examples
        --------
        >>> follower = GainFollower(
        ...     ((0.1, 0.2), (0.1, 0.5)), 0.1, dwell=2.0, hysteresis=0.01, rate=0.0
        ... )
        >>> [follower.update(time, 0.12, 0.15).number for time in (0.0, 1.9, 2.0)]
        [1, 1, 0]
        >>> follower.update(2.1, 0.12, 0.21).number
        1
        """
        if not (math.isfinite(time) and time >= self._time):
            raise ValueError(
                f"time={time} s comes after {self._time} s: give times that do not decrease"
            )
        self._time = time
        if not (informed and math.isfinite(low) and math.isfinite(high) and low <= high):
            return self._take(len(self.delays) - 1, covered=False)
        # A command is obeyed up to a delay and a sample later.
        change = self.rate * (high + self.sample_time)
        low, high = low - change, high + change
        robust = len(self.delays) - 1
        for i in range(robust):
            if not self._holds(i, low, high, self.hysteresis):
                self._inside_since[i] = math.inf
            elif self._inside_since[i] == math.inf:
                self._inside_since[i] = time
        current = self.choice.number
        for i in range(robust):
            if i >= current and self._holds(i, low, high, 0.0):
                return self._take(i, covered=True)
            if i < current and time - self._inside_since[i] >= self.dwell:
                return self._take(i, covered=True)
        return self._take(robust, covered=self._holds(robust, low, high, 0.0))

    def _holds(self, number: int, low: float, high: float, hysteresis: float) -> bool:
        """Whether the interval is in that of a set, with room above: no set is left downwards."""
        first, last = self.delays[number]
        return first <= low and high <= last - hysteresis

    def _take(self, number: int, covered: bool) -> Choice:
        if number > self.choice.number or not covered:
            # The time inside a faster set counts anew from a step down.
            for i in range(number):
                self._inside_since[i] = math.inf
        self.choice = Choice(number, covered)
        return self.choice
