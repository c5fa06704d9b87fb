"""Whether the air that is found is there while the vehicle rests, too.

Air takes the place of what a plant lacks. What the plant lacks shows while the vehicle moves; air
does not know of that. Changes of the residuals over a few rows are compared between rows at which
the vehicle moves and rows at which it rests. For the fitted noise their covariance is known: with
it each mean square has degrees of freedom (Satterthwaite 1946), and their ratio is about that of F.
The fit takes a part of what it sees while the vehicle moves: the probability is rather too large.
"""

from __future__ import annotations

import numpy as np

from deadtime._base.arrays import Array, Indices, Mask
from deadtime.estimation._native import RowLikelihood, RowNoise
from deadtime.estimation.likelihood._flight import NoiseFit
from deadtime.estimation.likelihood._rows import FlightRows

#: Rows over which changes are taken.
OVER = (4, 8, 16)

#: The vehicle moves at this share of its largest speed. What its plant lacks shows so many rows
#: longer; so many rows later the vehicle is taken to rest.
MOVES, SHOWS, RESTS = 0.25, 16, 48

#: Fewest changes of each kind, and how much longer than usual the time of one may be.
FEWEST, UNEVEN = 10, 0.1


def air_at_rest(fit: NoiseFit, run: int) -> float:
    """Probability of residuals that change so much more while the vehicle moves, by the noise."""
    rows, noise = fit.runs[run], fit.numbers.noise[run]
    # Rounding hides changes at rest, and commands that are late move the vehicle.
    if not (fit.model.integrates and noise.air > 0.0) or rows.rounding or noise.arrivals > 0.0:
        return 1.0
    return min(1.0, len(OVER) * min(_over(fit, run, rows, noise, count) for count in OVER))


def rows_since_motion(rows: FlightRows, part: RowLikelihood, places: Indices) -> Indices:
    """How many rows before these places the vehicle moved last; very many where it never did."""
    speed = np.abs(part.rate / part.gain)
    moves = np.flatnonzero(speed > MOVES * float(speed.max()))
    last = np.searchsorted(moves, places, side="right")
    return places - np.where(last > 0, moves[np.maximum(last, 1) - 1], -rows.time.size)


def _over(fit: NoiseFit, run: int, rows: FlightRows, noise: RowNoise, count: int) -> float:
    from scipy import special

    part = fit.parts[run]
    if rows.time.size <= count:
        return 1.0
    between = rows.row_time
    speed = np.abs(part.rate / part.gain)
    since = rows_since_motion(rows, part, np.arange(count, rows.time.size)) - count
    used = rows.used[count:] & rows.used[:-count]
    used &= np.abs(rows.time[count:] - rows.time[:-count] - count * between) < UNEVEN * between
    moving, resting = used & (since < SHOWS), used & (since > RESTS)
    if min(np.sum(moving), np.sum(resting)) < FEWEST:
        return 1.0
    changes = (part.residuals[count:] - part.residuals[:-count]) ** 2 / part.variance
    late = (noise.stamps * speed) ** 2
    late = late[count:] + late[:-count]
    covariance = _covariance(noise, between, count, rows.time.size)
    (size, freedom), (least, own_freedom) = (
        _mean_square(changes, late, covariance, mask) for mask in (moving, resting)
    )
    return float(special.fdtrc(freedom, own_freedom, size / least)) if least > 0.0 else 1.0


def _covariance(noise: RowNoise, between: float, count: int, size: int) -> Array:
    """Covariance of changes that begin so many rows apart, in white variances."""
    lags = np.arange(size)
    apart = [between * np.abs(lags + shift) for shift in (0, count, -count)]
    # Air moves the output by the integral of its speed: variance of that over a time.
    longs = [one / noise.air_time for one in apart]
    moved = [2.0 * (noise.air * noise.air_time) ** 2 * (x + np.expm1(-x)) for x in longs]
    total = 0.5 * (moved[1] + moved[2]) - moved[0]
    if noise.sensor > 0.0:
        alike = [noise.sensor**2 * np.exp(-one / noise.sensor_time) for one in apart]
        total += 2.0 * alike[0] - alike[1] - alike[2]
    total[0] += 2.0
    if count < size:
        total[count] -= 1.0
    return np.asarray(total)


def _mean_square(squares: Array, late: Array, covariance: Array, mask: Mask) -> tuple[float, float]:
    """Mean square over its expectation, and its degrees of freedom."""
    expected = covariance[0] + float(np.mean(late[mask]))
    count = int(np.sum(mask))
    length = 2 * mask.size
    pairs = np.fft.irfft(np.abs(np.fft.rfft(mask.astype(float), length)) ** 2, length)
    pairs = pairs[: mask.size]
    squared = covariance[: mask.size] ** 2
    both = pairs[0] * expected**2 + 2.0 * float(pairs[1:] @ squared[1:])
    return float(np.mean(squares[mask])) / expected, count**2 * expected**2 / both
