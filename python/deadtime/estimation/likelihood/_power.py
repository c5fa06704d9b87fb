"""The smallest further lag that a recording would have shown.

With a further lag L, and the delay shorter by L, the mean of the rows is another. What is left of
the whitened difference after the fitted numbers have followed it has a length δ, which grows with
L² at first because a lag is a delay to first order. Where a lag is fitted, it becomes the longer of
both, and the delay takes the place of the shorter: then δ grows no more. The root of the likelihood
ratio is about normal around δ (Wald 1943).
"""

from __future__ import annotations

import math
from dataclasses import replace

from deadtime.estimation._native import LONGEST_DELAY, FlightLikelihood, PlantNumbers
from deadtime.estimation.fit._residuals import SIGNIFICANCE
from deadtime.estimation.likelihood._flight import NoiseFit
from deadtime.estimation.likelihood._rows import excited_part, is_long

#: Probability with which the lag would have been found.
POWER = 0.9

#: Where the search begins, in rows.
FIRST = 1.0

#: Most evaluations, and the accuracy of δ that is enough.
EVALUATIONS, ENOUGH = 12, 0.01

#: Least power of the lag with which δ is taken to grow.
LEAST_ORDER = 0.3


def unseen_lag(fit: NoiseFit) -> float:
    """Below this further lag, s, the test for one finds it in less than 90 % of such recordings.

    Infinite where none would be found. A long recording shows at least what its excited part shows.
    """
    from scipy import special

    if is_long(fit.runs):
        fit = replace(fit, runs=tuple(excited_part(run) for run in fit.runs))

    # Half the distribution of the ratio is at zero.
    wanted = float(special.ndtri(1.0 - SIGNIFICANCE) + special.ndtri(POWER))
    one = fit.numbers
    between = fit.runs[0].row_time
    longest = min(LONGEST_DELAY * float(run.time[-1] - run.time[0]) for run in fit.runs)
    richer = replace(fit.model, extra=fit.model.extra + 1).likelihood(fit.runs, fit.trim)
    may_move = "delay" in fit.model.names

    def seen(lag: float) -> float:
        delay = max(0.0, one.delay - lag) if may_move else one.delay
        with_lag = PlantNumbers(delay, [*one.lags, lag], one.noise, fit.gain, one.zero)
        means = [
            run._replace(output=run.output - richer.at(i, with_lag).residuals)
            for i, run in enumerate(fit.runs)
        ]
        return _left(fit, fit.model.likelihood(means, fit.trim), lag)

    low, high, below = 0.0, longest, 0.0
    lag, order = FIRST * between, 2.0
    for _ in range(EVALUATIONS):
        found = seen(lag)
        if abs(found - wanted) <= ENOUGH * wanted:
            return lag
        if found > wanted:
            high = lag
        elif found <= below or low >= longest * (1.0 - 1e-3):
            return math.inf
        else:
            if low > 0.0:
                order = max(math.log(found / below) / math.log(lag / low), LEAST_ORDER)
            low, below = lag, found
        guess = lag * (wanted / max(found, 1e-9)) ** (1.0 / order)
        lag = guess if low < guess < high else 0.5 * (low + high)
    return lag


def unseen_in_words(lag: float) -> str:
    """The further lag that would not be seen, up to the verb."""
    if math.isinf(lag):
        return "no further lag would"
    return f"a further lag below {lag:.2g} s would not"


def _left(fit: NoiseFit, likelihood: FlightLikelihood, lag: float) -> float:
    """Length of what the fitted numbers leave of these rows, in white deviations of the fit.

    They follow a further lag from where they are, and where a free lag is longer by as much.
    """
    one = fit.with_gain
    starts = [one]
    if "delay" in fit.model.names:
        for place, free in enumerate(fit.model.free_lags):
            lags = list(one.lags)
            lags[place] += lag
            delay = max(0.0, one.delay - lag)
            if free:
                starts.append(PlantNumbers(delay, lags, one.noise, one.gain, one.zero))
    found = min(
        (likelihood.fit(start, ENOUGH, noise=False) for start in starts),
        key=lambda numbers: numbers.objective,
    )
    total = 0.0
    for run, own in enumerate(fit.parts):
        part = likelihood.at(run, found)
        total += part.variance * part.freedom / own.variance
    return math.sqrt(total)
