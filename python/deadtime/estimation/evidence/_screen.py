"""Whether it is worth to fit other plants: a cheap look at what a fit leaves.

What another linear plant adds to a fit is, to first order, a combination of the command behind lags
and delays. These columns are fitted to the residuals. If all of them together gain no more than
chance and `CLEAR`, no single plant does. Coloured residuals count as fewer independent rows.
"""

from __future__ import annotations

import math

import numpy as np

from deadtime._base.arrays import Array
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._checks import independent_samples
from deadtime.estimation.evidence._question import Question
from deadtime.estimation.evidence._words import CLEAR
from deadtime.estimation.models._held import HeldResponse

#: Lags of the columns, from so many rows to this share of the window, and how many. More: a plant
#: between them is seen better, and chance gains more.
SHORTEST, LONGEST, LAGS = 2.0, 0.3, 4


def may_have_rivals(fit: DelayEstimate, question: Question) -> bool:
    """Whether the command behind lags and delays explains what a fit leaves, beyond chance."""
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
    least, _ = _left(base, residuals)
    less, colour = _left(base + others, residuals)
    floor = float(np.finfo(float).tiny)
    gained = independent_samples(time.size, colour) * math.log(max(least, floor) / max(less, floor))
    return gained > CLEAR + len(others)


def _left(columns: list[Array], target: Array) -> tuple[float, float]:
    """Sum of squares that least squares leaves of a target, and its lag-1 autocorrelation."""
    sizes = [max(float(np.linalg.norm(column)), np.finfo(float).tiny) for column in columns]
    scaled = np.array([column / size for column, size in zip(columns, sizes, strict=True)]).T
    found, *_ = np.linalg.lstsq(scaled, target, rcond=None)
    left = target - scaled @ found
    total = float(left @ left)
    return total, float(left[1:] @ left[:-1]) / total if total > 0.0 else 0.0
