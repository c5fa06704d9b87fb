"""Whether recordings that are fitted jointly agree about the vehicle.

Each is fitted alone, from the joint fit. Its gain and its sum of delay and lag are compared with
their weighted means (Cochran 1954): Q = sum of ((value_i - mean)/stderr_i)^2 is chi-squared with
one degree of freedom less than there are recordings. Student's quantiles widen the standard errors
of recordings whose noise is known from few rows.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from deadtime._base.digits import stated
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import ROUGH, PlantNumbers
from deadtime.estimation.fit._residuals import SIGNIFICANCE
from deadtime.estimation.likelihood._profile import LikelihoodProfile

#: Level of the quantiles that widen the standard errors.
LEVEL = 0.95


def contradictions(profile: LikelihoodProfile) -> list[str]:
    """Each quantity of which the recordings differ more than their errors allow, in words."""
    fit = profile.fit
    if len(fit.runs) < 2:
        return []
    alone = [_alone(profile, run) for run in range(len(fit.runs))]
    told = [one for one in alone if one is not None]
    found = []
    for name, kernel in profile.names.items():
        if kernel in ("gain", "total"):
            values, errors = np.array([_value_of(one, name) for one in told]).reshape(-1, 2).T
            if differ(values, errors) < SIGNIFICANCE:
                unit = "" if kernel == "gain" else "s"
                pairs = zip(values.tolist(), errors.tolist(), strict=True)
                shown = ", ".join(stated(value, error, unit) for value, error in pairs)
                found.append(f"the recordings contradict one another: {name} {shown}")
    return found


def _alone(profile: LikelihoodProfile, run: int) -> LikelihoodProfile | None:
    """The profile of one of the recordings alone; None if it tells nothing by itself."""
    fit = profile.fit
    one = fit.numbers
    only = replace(fit, runs=(fit.runs[run],), given_gain=None)
    start = PlantNumbers(one.delay, one.lags, [one.noise[run]], fit.gain, one.zero)
    found = LikelihoodProfile(only.moved(only.likelihood.fit(start, ROUGH)), profile.names)
    try:
        tells = all(math.isfinite(error) for error in found.stderr.values())
    except NotIdentifiableError:
        return None
    return found if tells else None


def _value_of(profile: LikelihoodProfile, name: str) -> tuple[float, float]:
    """A quantity of one recording and its standard error, for a Gaussian quantile."""
    from scipy import special

    fit = profile.fit
    one = fit.numbers
    value = fit.gain
    if profile.names[name] == "total":
        value = one.delay + math.fsum(one.lags) - one.zero + fit.model.own_lag
    reach = float(special.stdtrit(profile.freedom[name], 0.5 + LEVEL / 2))
    wider = reach / float(special.ndtri(0.5 + LEVEL / 2))
    return value, profile.stderr[name] * wider


def differ(values: np.ndarray, errors: np.ndarray) -> float:
    """The probability of differences as large as these between equal quantities."""
    from scipy import special

    if values.size < 2 or not np.all(errors > 0.0):
        return 1.0
    weights = errors**-2.0
    mean = float(weights @ values / weights.sum())
    square = float(np.sum(((values - mean) / errors) ** 2))
    return float(special.chdtrc(values.size - 1, square))
