"""The whole periods of a periodic experiment, and the lines that its reference excites."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Indices
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.recordings import Recording

#: A line of the reference counts as excited above this share of the largest line.
EXCITED = 1e-3

#: Lines to either side over which the kernel averages covariances.
NEIGHBOURS = 1

#: Largest deviation of a period from a whole number of samples, in samples.
WHOLE = 1e-3


class Periods(NamedTuple):
    """The whole periods that are used, and the lines of each.

    Attributes
    ----------
    rows : slice
    samples, repeated : int
        Samples in a period, and periods.
    lines : ndarray of int
        Harmonics of the period that the reference excites.
    """

    rows: slice
    samples: int
    repeated: int
    lines: Indices

    @property
    def freedom(self) -> float:
        """Complex degrees of freedom of the covariances between periods, averaged at the ends."""
        return max(1.5, float((self.repeated - 1) * min(self.lines.size, 1 + NEIGHBOURS)))


def whole_periods(data: Recording, period: float, left_out: int, highest: float) -> Periods:
    """The whole periods after the first `left_out`, and their lines up to `highest` Hz."""
    h = data.sample_time
    samples = round(period / h)
    if abs(period / h - samples) > WHOLE or samples < 4:
        raise ValueError(
            f"period={period:g} s is {period / h:.4g} samples of {h:g} s: "
            "give a period that is a whole number of samples, at least four"
        )
    begin = whole_number("left_out", left_out, least=0) * samples
    periods = (len(data) - begin) // samples
    if periods < 2:
        raise NotIdentifiableError(
            f"{max(0, periods)} periods of {period:g} s remain after {left_out} are "
            "left out, but at least two are needed for their covariance: record longer"
        )
    begin = len(data) - periods * samples  # the last ones, in which the transient has decayed most

    reference = data.reference[begin:].reshape(periods, samples)
    spread = float(np.max(np.ptp(reference, axis=0)))
    if spread > 1e-6 * float(np.ptp(reference)) or float(np.ptp(reference)) == 0.0:
        raise NotIdentifiableError(
            f"the reference does not repeat every {period:g} s (its periods differ by "
            f"{spread:.3g}, or it is constant): give the period of Experiment.multisine"
        )
    power = np.abs(np.fft.rfft(reference[0]))
    power[0] = 0.0  # the mean of an integrator's output holds no information
    excited = (power > EXCITED * power.max()) & (np.arange(power.size) / period <= highest)
    lines = np.flatnonzero(excited)
    lines = lines[2 * lines < samples]
    return Periods(slice(begin, None), samples, periods, lines)
