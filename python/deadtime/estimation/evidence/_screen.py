"""Whether it is worth to fit other plants: a cheap look at what a fit leaves.

What another linear plant adds to a fit is, to first order, a combination of the command behind lags
and delays. These columns are fitted to the residuals, both whitened by the noise of the fit. If all
of them together gain no more than chance and `CLEAR`, no single plant does. Residuals that are
coloured even so count as fewer independent rows.

What a fit takes for air may be what its plant lacks. So the columns are also fitted to the
residuals as they are, and may not explain most of them. Of air that walks they explain a part.
"""

from __future__ import annotations

import math

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation._native import FlightProfile, HeldResponse
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._checks import independent_samples
from deadtime.estimation.evidence._candidate import CLEAR
from deadtime.estimation.evidence._question import Question
from deadtime.estimation.likelihood._disturbances import Disturbance, whitened

#: Lags of the columns, from so many rows to this share of the window, and how many. More: a plant
#: between them is seen better, and chance gains more.
SHORTEST, LONGEST, LAGS = 2.0, 0.3, 4

#: Share of the residuals from which they follow the command, and are no air. More: a plant that air
#: has replaced is not found; less: air alone asks for the family.
FOLLOWS = 0.9


def may_have_rivals(fit: DelayEstimate, question: Question) -> bool:
    """Whether the command behind lags and delays explains what a fit leaves, beyond chance.

    What least squares leaves of a plant that lacks something has no noise to compare with.
    """
    if fit.verdict == "indication" and not isinstance(fit._profile, FlightProfile):
        return True
    rows = question.recording.time[question.earlier :]
    known = np.isfinite(fit.residuals)
    known &= (fit.recording.time >= rows[0]) & (fit.recording.time <= rows[-1])
    time, residuals = fit.recording.time[known], fit.residuals[known]
    command = question.command
    response = HeldResponse(question.recording.time, command - command[0])
    lags = np.geomspace(SHORTEST * fit.recording.sample_time, LONGEST * float(np.ptp(time)), LAGS)
    own = response.at(time - fit.delay, fit.lag or 0.0)
    base = [np.ones(time.size), time - time[0], own.value, own.rate, own.by_lag]
    others = [response.at(time).value]
    others += [response.at(time - late, lag).rate for lag in lags for late in (0.0, fit.delay)]
    if time.size <= 2 * len(base + others):
        return True
    columns = np.array([residuals, *base, *others])
    beyond = CLEAR + len(others)
    gain, share = _gained(columns, len(base))
    if gain > beyond and share > FOLLOWS:
        return True
    return _gained(_whitened(fit, time, columns), len(base))[0] > beyond


def _whitened(fit: DelayEstimate, time: Array, columns: Array) -> Array:
    """Columns, a row each, whitened by the air and the coloured noise of a fit."""
    profile = fit._profile
    if not isinstance(profile, FlightProfile):
        return columns
    noise = profile.fit.numbers.noise[0]
    every = (
        Disturbance(True, noise.air_time, noise.air),
        Disturbance(False, noise.sensor_time, noise.sensor),
    )
    return whitened(fit.loop.plant, time, columns, [one for one in every if one.deviation > 0.0])


def _gained(columns: Array, few: int) -> tuple[float, float]:
    """What all columns gain in 2 ln L beyond a `few`, for the first one; the share they explain."""
    least, _ = _left(columns[: few + 1])
    less, colour = _left(columns)
    gain = independent_samples(columns.shape[1], colour) * math.log(least / less)
    return gain, 1.0 - less / least


def _left(columns: Array) -> tuple[float, float]:
    """Sum of squares that the others leave of the first column, and its lag-1 autocorrelation."""
    floor = float(np.finfo(float).tiny)
    sizes = np.maximum(np.linalg.norm(columns[1:], axis=1), floor)
    scaled = (columns[1:] / sizes[:, None]).T
    found, *_ = np.linalg.lstsq(scaled, columns[0], rcond=None)
    left = columns[0] - scaled @ found
    total = float(left @ left)
    return max(total, floor), float(left[1:] @ left[:-1]) / total if total > 0.0 else 0.0
