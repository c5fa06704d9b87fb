"""Whether the delay is the same over the window.

A command that comes later than the fitted delay says moves the output later. Beside the fitted
model, the delays of the commands are taken to wander around it: with a standard deviation and a
correlation time of their own, from a small part of the window, as in a busy network, to the whole
of it, as in a drift. To first order, the rows then have the noise of the fit and a further Gaussian
part: the change of the rows by these delays, less what the fitted numbers follow. The ratio of its
likelihood (Patterson & Thompson 1971) with the likeliest such delays and with none is the test.

Air, scattered times or a coloured sensor may stand for the change where they were fitted. There the
delays also wander beside a fit without these, which has to be about as likely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation._native import ROUGH
from deadtime.estimation.likelihood._flight import NoiseFit, changed, with_noise
from deadtime.estimation.likelihood._rows import FlightRows, is_long

#: Delays that wander are sums of so many waves at most, with 1, 2, ... half periods in the window,
#: one for so many rows.
WAVES, ROWS = 12, 3

#: Correlation times of the delays, as shares of the window.
CORRELATION_TIMES = np.array([1 / 16, 1 / 8, 1 / 4, 1.0])

#: Variance that the delays add to the rows along what shows best, in white variances.
ADDED = np.geomspace(0.3, 3e5, 25)

#: Share of what shows best below which a sum of waves does not show.
SHOWS = 1e-9

#: How much less likely, in −2 ln L, than a fit with air, scattered times or a coloured sensor one
#: without these and with delays that wander may be. In air of 0.002 m/s/√s, 1 in 200 flights with a
#: constant delay is doubted more than at 0, and of flights with a wandering one 1 in 100.
AS_LIKELY = 1.0

#: Share of recordings with a constant delay whose statistic is above a chi-square of one degree of
#: freedom, in which a variance at its bound has a part of one half (Self & Liang 1987), and less
#: where few rows tell. A statistic above DRAWN is held against so many drawn ones.
SOME, DRAWN, DRAWS = 0.3, 2.0, 4000


class DelayChange(NamedTuple):
    """How the delay changes.

    Attributes
    ----------
    p_value : float
        Probability of residuals as much like such a change where the delay is constant.
    spread : float
        Standard deviation of the likeliest delay over the changes of the command, s.
    """

    p_value: float
    spread: float


#: Where no change can be seen.
NONE_SEEN = DelayChange(1.0, 0.0)


def delay_change(fit: NoiseFit, run: int) -> DelayChange:
    """The test for one of the recordings."""
    rows = fit.runs[run]
    jumps = np.diff(rows.command, prepend=rows.command[0])
    if "delay" not in fit.model.names or not np.any(jumps) or _number(rows) == 0:
        return NONE_SEEN
    found = _wandering(fit, run)
    own = fit.numbers.noise[run]
    quiet = changed(own, air=0.0, sensor=0.0, stamps=0.0, arrivals=0.0)
    if max(own.air, own.sensor, own.stamps, own.arrivals) > 0.0 and not is_long(fit.runs):
        noises = [*fit.numbers.noise[:run], quiet, *fit.numbers.noise[run + 1 :]]
        calm = fit.moved(fit.likelihood.fit(with_noise(fit.with_gain, noises), ROUGH, noise=False))
        if math.isfinite(calm.gain):  # else the rows do not tell it there
            beside = _wandering(calm, run)
            less_likely = calm.numbers.objective - beside.fall - fit.numbers.objective
            if less_likely < AS_LIKELY and beside.fall > found.fall:
                found = beside
    if found.fall <= 0.0:
        return NONE_SEEN
    delays = found.delays() @ _waves(rows)
    weights = jumps**2 / np.sum(jumps**2)
    spread = math.sqrt(float(weights @ (delays - weights @ delays) ** 2))
    return DelayChange(found.p_value(), spread)


@dataclass(frozen=True)
class _Wandering:
    """Delays that wander beside a fit.

    Attributes
    ----------
    left, shown, right : ndarray
        Of every correlation time, the waves in their sizes by singular values, in white deviations.
    sizes : ndarray
        Of every correlation time, the standard deviations of the waves.
    along : ndarray
        The residuals along the waves.
    freedom : int
        Sum of squares of all residuals.
    """

    left: Array
    shown: Array
    right: Array
    sizes: Array
    along: Array
    freedom: int

    @cached_property
    def added(self) -> Array:
        """Variances by correlation time, size, and direction."""
        largest = np.maximum(self.shown[:, :1], np.finfo(float).tiny)
        return ADDED[:, None] * (self.shown / largest)[:, None, :] ** 2

    def falls(self, along: Array) -> Array:
        """By how much −2 ln L falls, by correlation time, recording, and size."""
        share = np.swapaxes(self.added / (1.0 + self.added), 1, 2)
        explained = (along @ self.left) ** 2 @ share / self.freedom
        large = np.sum(np.log1p(self.added), axis=2)
        return np.asarray(-self.freedom * np.log1p(-explained) - large[:, None, :])

    @cached_property
    def likeliest(self) -> tuple[float, int, int]:
        """By how much −2 ln L falls with the likeliest, its correlation time, and its size."""
        falls = self.falls(self.along[None, :])[:, 0, :]
        time, size = np.unravel_index(int(np.argmax(falls)), falls.shape)
        return float(falls[time, size]), int(time), int(size)

    @property
    def fall(self) -> float:
        """By how much −2 ln L falls with the likeliest; zero where none shows."""
        return self.likeliest[0] if np.any(self.shown) else 0.0

    def p_value(self) -> float:
        """Probability of such a fall where the delay is constant (Dufour 2006)."""
        from scipy import special

        if self.fall <= DRAWN:
            return SOME * float(special.chdtrc(1, self.fall))
        return (1.0 + float(np.sum(self.drawn() >= self.fall))) / (DRAWS + 1.0)

    def delays(self) -> Array:
        """The likeliest delays, as sizes of the waves, s."""
        _, time, size = self.likeliest
        shown, added = self.shown[time], self.added[time, size]
        seen = shown > SHOWS * shown[0]
        parts = (self.along @ self.left[time])[seen] / shown[seen]
        parts *= (added / (1.0 + added))[seen]
        return np.asarray(self.sizes[time] * (parts @ self.right[time, seen]))

    def drawn(self) -> Array:
        """Such a fall in recordings with a constant delay."""
        random = np.random.default_rng(0)
        along = random.standard_normal((DRAWS, self.along.size))
        rest = random.chisquare(max(self.freedom - self.along.size, 1), DRAWS)
        along *= np.sqrt(self.freedom / (np.sum(along**2, axis=1) + rest))[:, None]
        return np.asarray(np.max(self.falls(along), axis=(0, 2)))


def _wandering(fit: NoiseFit, run: int) -> _Wandering:
    """Delays that wander beside the fit of one recording."""
    number = _number(fit.runs[run])
    factor, along, freedom = fit.likelihood.waves(run, fit.with_gain, number)
    # Variances of the waves of a first-order noise; those of each correlation time add to one.
    phase = np.pi * np.outer(CORRELATION_TIMES, np.arange(1, number + 1))
    variances = 1.0 / (1.0 + phase**2)
    sizes = np.sqrt(variances / np.sum(variances, axis=1, keepdims=True))
    left, shown, right = np.linalg.svd(factor.reshape(number, number) * sizes[:, None, :])
    return _Wandering(left, shown, right, sizes, along, freedom)


def _number(rows: FlightRows) -> int:
    """How many waves these rows can tell."""
    return min(WAVES, int(np.sum(rows.used)) // ROWS)


def _waves(rows: FlightRows) -> Array:
    """The waves of the delay, each at every command, shape (k, n)."""
    since = rows.command_time - rows.time[0]
    share = np.clip(since / (rows.time[-1] - rows.time[0]), 0.0, 1.0)
    return np.cos(np.pi * np.outer(np.arange(1, _number(rows) + 1), share))
