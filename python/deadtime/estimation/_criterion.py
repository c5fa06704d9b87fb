"""Schwarz's criterion (BIC) of an estimate, by which plants are compared."""

from __future__ import annotations

import math

import numpy as np

from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.likelihood._profile import LikelihoodProfile


def bic(fit: DelayEstimate) -> float:
    """Schwarz's criterion of the fit, from the plain likelihood."""
    rows = sum(run.residuals.size for run in fit.runs)
    unknown = len(fit.free)
    if not isinstance(fit._profile, LikelihoodProfile):  # least squares: white noise
        square = np.concatenate([run.residuals for run in fit.runs]) ** 2
        least = max(float(np.mean(square)), np.finfo(float).tiny)
        return rows * math.log(least) + unknown * math.log(rows)
    fitted, total = fit._profile.fit, 0.0
    for part, one, noise in zip(fitted.parts, fitted.runs, fitted.numbers.noise, strict=True):
        count = int(np.sum(one.used))
        total += count * math.log(part.variance * part.freedom / count) + part.log_det
        unknown += fitted.trim + 2 * (noise.sensor > 0.0)
    return total + unknown * math.log(rows)
