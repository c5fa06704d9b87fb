"""Whether the delay is the same over the window.

A command that comes later than the fitted delay says moves the output later. The score test (Rao
1948) takes delays that change over the window, u from 0 to 1, as

    delay + c1 cos(π u) + c2 cos(2 π u):

of the whitened change of the rows by c1 and c2 it takes what the fitted numbers do not follow, and
holds the whitened residuals against that. Without a change the squared length of that projection is
chi-squared with two degrees of freedom. Where air or scattered times were fitted, they may stand
for the change: there the likelihood ratio of a fit of both counts, or of a change without air where
it is clearly likelier than a constant delay with them: each has about two numbers. A drift and a
slow wandering show here more often than in the cumulated score of the delay (Nyblom 1989), which is
for a change at any one time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime._deadtime import PlantNumbers, RowNoise
from deadtime.estimation.likelihood._rows import FlightRows
from deadtime.estimation.likelihood._search import ROUGH, NoiseFit, changed, with_noise
from deadtime.estimation.likelihood._start import is_long

Array = NDArray[np.float64]

#: Periods of the changes, in half windows.
WAVES = (1, 2)

#: Step of difference quotients, in rows.
STEP = 1e-3

#: Share of the time between two commands by which they may come closer.
CLOSER = 0.9

#: Rise of -2 ln L by which a changing delay without air has to be likelier than a constant one in
#: air or with scattered times. 1 % of flights in weak air have more, and 2 % of those with jitter.
CLEARLY = 6.0

#: Share of a change that the fitted numbers have to leave.
LEFT = 1e-3


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
    from scipy import special

    rows = fit.runs[run]
    jumps = np.diff(rows.command, prepend=rows.command[0])
    if "delay" not in fit.model.names or not np.any(jumps):
        return NONE_SEEN
    square, delays = _scored(fit, run)
    own = fit.numbers.noise[run]
    if max(own.air, own.stamps, own.arrivals) > 0.0 and not is_long(fit.runs):
        quiet = list(fit.numbers.noise)
        quiet[run] = changed(own, air=0.0, stamps=0.0, arrivals=0.0)
        calm = fit.moved(fit.likelihood.fit(with_noise(fit.with_gain, quiet), ROUGH, noise=False))
        beside = fit
        for start in (calm, None):
            one = start or beside
            if not math.isfinite(one.gain):  # the rows do not tell it there
                continue
            later = _later(beside, run, _scored(one, run)[1], (fit.numbers.noise, quiet))
            if not math.isfinite(later.gain):
                continue
            beside = later
            rise = fit.numbers.objective - beside.numbers.objective
            if rise > CLEARLY and beside.numbers.noise[run].air == 0.0:
                rise = math.inf
            if rise > square:
                square, delays = rise, _times(beside, run) - _times(fit, run)
    weights = jumps**2 / np.sum(jumps**2)
    spread = math.sqrt(float(weights @ (delays - weights @ delays) ** 2))
    return DelayChange(float(special.chdtrc(len(WAVES), max(square, 0.0))), spread)


def _times(fit: NoiseFit, run: int) -> Array:
    return fit.runs[run].command_time


def _later(
    fit: NoiseFit, run: int, delays: Array, noises: Sequence[Sequence[RowNoise]]
) -> NoiseFit:
    """The likeliest numbers and noise with commands that are later by these times."""
    rows = fit.runs[run]
    runs = list(fit.runs)
    runs[run] = _with_later(rows, delays)
    moved = replace(fit, runs=tuple(runs))
    found = [moved.likelihood.fit(with_noise(fit.with_gain, noise), ROUGH) for noise in noises]
    return moved.moved(min(found, key=lambda numbers: numbers.objective))


def _scored(fit: NoiseFit, run: int) -> tuple[float, Array]:
    """The statistic for the noise of the fit, and the likeliest change at each command, s."""
    rows, one = fit.runs[run], fit.with_gain
    shapes = _shapes(rows)
    numbers = PlantNumbers(one.delay, one.lags, [one.noise[run]], fit.gain, one.zero)
    step = STEP * rows.row_time
    mean = _residuals(fit, rows, numbers)
    changes = [_with_later(rows, step * shape) for shape in shapes]
    columns = [(mean - _residuals(fit, one, numbers)) / step for one in changes]
    others = [(mean - _residuals(fit, rows, one)) / step for one in _neighbours(fit, numbers, step)]
    own, followed = (_whitened(fit, rows, numbers, some) for some in (columns, others))
    basis = np.linalg.qr(followed)[0]
    left = own - basis @ (basis.T @ own)
    seen = np.linalg.norm(left, axis=0) > LEFT * np.linalg.norm(own, axis=0)
    if not np.any(seen):
        return 0.0, np.zeros(rows.command_time.size)
    basis, factor = np.linalg.qr(left[:, seen])
    part = fit.parts[run]
    along = basis.T @ part.whitened
    size = math.sqrt(part.variance)
    return float(along @ along), size * np.linalg.lstsq(factor, along)[0] @ shapes[seen]


def _with_later(rows: FlightRows, delays: Array) -> FlightRows:
    """The rows with commands that are later by these times, as far as they keep their order."""
    closer = -np.diff(delays) / np.diff(rows.command_time)
    share = min(1.0, CLOSER / max(float(np.max(closer, initial=0.0)), CLOSER))
    return rows._replace(command_time=rows.command_time + share * delays)


def _shapes(rows: FlightRows) -> Array:
    """The changes of the delay at each command, shape (2, n)."""
    since = rows.command_time - rows.time[0]
    share = np.clip(since / (rows.time[-1] - rows.time[0]), 0.0, 1.0)
    return np.cos(np.pi * np.outer(WAVES, share))


def _neighbours(fit: NoiseFit, numbers: PlantNumbers, step: float) -> Iterator[PlantNumbers]:
    """The numbers with each time that is fitted larger by a step."""
    one, lags = numbers, numbers.lags

    def at(delay: float, lags: Sequence[float], zero: float) -> PlantNumbers:
        return PlantNumbers(delay, lags, one.noise, one.gain, zero)

    yield at(one.delay + step, lags, one.zero)
    for place, free in enumerate(fit.model.free_lags):
        if free:
            longer = [lag + step * (i == place) for i, lag in enumerate(lags)]
            yield at(one.delay, longer, one.zero)
    if "zero" in fit.model.names:
        yield at(one.delay, lags, one.zero + step)


def _residuals(fit: NoiseFit, rows: FlightRows, numbers: PlantNumbers) -> Array:
    return fit.model.likelihood([rows], fit.trim).at(0, numbers).residuals


def _whitened(
    fit: NoiseFit, rows: FlightRows, numbers: PlantNumbers, columns: Sequence[Array]
) -> Array:
    """Columns of the rows, whitened, less what gain, offset and trim follow; shape (n, k)."""
    found = []
    for column in columns:
        part = fit.model.likelihood([rows._replace(output=column)], fit.trim).at(0, numbers)
        found.append(part.whitened * math.sqrt(part.variance))
    return np.stack(found, axis=1)
