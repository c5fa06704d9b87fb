"""The smallest further lag that a recording would have shown.

With a further lag L, and the delay shorter by L, the mean of the rows is another. What is left of
the whitened difference after the fitted numbers have followed it, by Gauss and Newton's method, has
a length δ, which grows with L² at first because a lag is a delay to first order. The root of the
likelihood ratio is about normal around δ (Wald 1943).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deadtime._deadtime import FlightLikelihood, PlantNumbers
from deadtime.estimation.fit._residuals import SIGNIFICANCE
from deadtime.estimation.likelihood._search import LONGEST, NoiseFit
from deadtime.estimation.likelihood._start import excited_part, is_long

Array = NDArray[np.float64]

#: Probability with which the lag would have been found.
POWER = 0.9

#: Steps of difference quotients, shortest lags, and where the search begins, in rows.
STEP, SHORTEST, FIRST = 0.05, 1e-3, 1.0

#: Most rounds of Gauss and Newton's method; singular values below this share are none.
ROUNDS, SINGULAR = 8, 1e-6

#: Most evaluations, and the accuracy of δ that is enough.
EVALUATIONS, ENOUGH = 12, 0.01


def unseen_lag(fit: NoiseFit) -> float:
    """Below this further lag, s, the test for one finds it in less than 90 % of such recordings.

    The longest lag of the search where none would be found. A long recording shows at least what
    its excited part shows.
    """
    from scipy import special

    if is_long(fit.runs):
        fit = replace(fit, runs=tuple(excited_part(run) for run in fit.runs))

    # Half the distribution of the ratio is at zero.
    wanted = float(special.ndtri(1.0 - SIGNIFICANCE) + special.ndtri(POWER))
    one = fit.numbers
    between = float(np.median(np.diff(fit.runs[0].time)))
    longest = min(LONGEST * float(run.time[-1] - run.time[0]) for run in fit.runs)
    richer = replace(fit.model, extra=fit.model.extra + 1).likelihood(fit.runs, fit.trim)
    may_move = "delay" in fit.model.names

    def seen(lag: float) -> float:
        delay = max(0.0, one.delay - lag) if may_move else one.delay
        with_lag = PlantNumbers(delay, [*one.lags, lag], one.noise, fit.gain, one.zero)
        means = [
            run._replace(output=run.output - richer.at(i, with_lag).residuals)
            for i, run in enumerate(fit.runs)
        ]
        return _left(fit, fit.model.likelihood(means, fit.trim), STEP * between)

    low, high = 0.0, longest
    lag, order = FIRST * between, 2.0
    for _ in range(EVALUATIONS):
        found = seen(lag)
        if abs(found - wanted) <= ENOUGH * wanted:
            break
        low, high = (lag, high) if found < wanted else (low, lag)
        guess = lag * (wanted / max(found, 1e-9)) ** (1.0 / order)
        lag = guess if low < guess < high else 0.5 * (low + high)
        if low >= longest * (1.0 - 1e-3):
            return longest
    return lag


def _left(fit: NoiseFit, likelihood: FlightLikelihood, step: float) -> float:
    """Length of what the fitted numbers leave of these rows, in white deviations of the fit."""
    kernel = [name for name, _ in fit.model.order if name != "gain" or len(fit.runs) > 1]
    at = dict.fromkeys(kernel, 0.0)
    left = _whitened(fit, likelihood, at)
    for _ in range(ROUNDS):
        slopes = [
            (_whitened(fit, likelihood, at | {name: at[name] + step}) - left) / step
            for name in kernel
        ]
        if not slopes:
            break
        change = np.linalg.lstsq(np.stack(slopes, axis=1), -left, rcond=SINGULAR)[0]
        moved = {name: at[name] + float(by) for name, by in zip(kernel, change, strict=True)}
        after = _whitened(fit, likelihood, moved)
        is_done = np.linalg.norm(after) > (1.0 - ENOUGH) * np.linalg.norm(left)
        if np.linalg.norm(after) < np.linalg.norm(left):
            at, left = moved, after
        if is_done:
            break
    return float(np.linalg.norm(left))


def _whitened(fit: NoiseFit, likelihood: FlightLikelihood, by: Mapping[str, float]) -> Array:
    """Whitened residuals where the fitted numbers are moved by so much."""
    one = fit.numbers
    least = SHORTEST * float(np.median(np.diff(fit.runs[0].time)))
    names = fit.model.lag_names
    lags = [
        max(lag + by[name], least) if name in by else lag
        for name, lag in zip(names, one.lags, strict=True)
    ]
    moved = PlantNumbers(
        max(0.0, one.delay + by.get("delay", 0.0)),
        lags,
        one.noise,
        fit.gain * (1.0 + by.get("gain", 0.0)),
        one.zero + by.get("zero", 0.0),
    )
    found = []
    for run, part in enumerate(fit.parts):
        there = likelihood.at(run, moved)
        found.append(there.whitened * np.sqrt(there.variance / part.variance))
    return np.concatenate(found)
