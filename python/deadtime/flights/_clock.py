"""The vehicle's clock: when an output was measured, whatever its message waited for.

A row of a recording holds the newest message at a sample of the controller, which is as old as the
time since that message, the wait on the link and a busy machine have it. The vehicle's own clock
stamps each message. The least of the differences between arrival and stamp, over every `STRETCH`
seconds, lie on a line where both clocks run evenly; its slope is their difference in rate. On a
link with much jitter their medians lie closer to one. By that line the stamps are converted to
times of this computer, up to a constant.

That constant does not matter: the delay of the loop contains the age of the row on which a command
is computed, so the mean age of the rows is added to all times. An estimate on these times is of the
delay from the command to the output plus the mean age, which is the mean delay of the loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Time over which the least difference of the clocks is sought, s.
STRETCH = 2.0

#: The quantiles that are tried.
LEAST, MEDIAN = 0.0, 0.5

#: Fewest stretches for a line.
FEWEST = 3

#: Clocks that are this far from a line, s, cannot be converted: the vehicle or this machine stood
#: still, or one of them ran slowly. To this come so many standard errors of a median.
MISFIT, ERRORS = 0.005, 3.0


@dataclass(frozen=True)
class VehicleClock:
    """Conversion of the vehicle's times to those of this computer.

    Attributes
    ----------
    rate, offset : float
        time = rate * stamp + offset, s; a fast message arrives at the time of its stamp.
    misfit : float
        Largest distance of the differences from the line, s.
    allowed : float
        The misfit of clocks that run evenly, at most, s: more where messages wait irregularly.
    """

    rate: float
    offset: float
    misfit: float
    allowed: float = MISFIT

    @property
    def even(self) -> bool:
        """Whether both clocks ran evenly."""
        return self.misfit <= self.allowed

    @classmethod
    def of(cls, arrival: Array, stamp: Array) -> VehicleClock | None:
        """From the arrivals of messages and their stamps, s; None where there are too few."""
        if arrival.size < 2 or not np.all(np.isfinite(stamp)):
            return None
        difference = arrival - stamp
        places = ((arrival - arrival[0]) / STRETCH).astype(int)
        whole = places < places[-1]
        if np.unique(places[whole]).size < FEWEST:
            return None
        stretches = [np.flatnonzero(places == stretch) for stretch in np.unique(places[whole])]
        lines = [cls._through(stamp, difference, stretches, share) for share in (LEAST, MEDIAN)]
        return min(lines, key=lambda line: line.misfit / line.allowed)

    @classmethod
    def _through(
        cls, stamp: Array, difference: Array, stretches: list[NDArray[np.intp]], share: float
    ) -> VehicleClock:
        """The line through one quantile of the differences in each stretch."""
        x = np.array([np.mean(stamp[rows]) for rows in stretches]) - stamp[0]
        y = np.array([np.quantile(difference[rows], share) for rows in stretches])
        slope, offset = np.polyfit(x, y, 1)
        misfit = float(np.max(np.abs(y - slope * x - offset)))
        allowed = MISFIT
        if share == MEDIAN:
            # The standard error of the median of normal numbers.
            deviations = [np.std(difference[rows]) / np.sqrt(rows.size) for rows in stretches]
            allowed += ERRORS * np.sqrt(0.5 * np.pi) * float(np.median(deviations))
        return cls(1.0 + float(slope), float(offset - slope * stamp[0]), misfit, float(allowed))

    def time(self, stamp: Array) -> Array:
        """The times of stamps, s."""
        return self.rate * stamp + self.offset
