"""Colour of the whitened residuals that is there while the vehicle rests, too.

A position may be corrected by a satellite fix five times a second. No air and no noise of a sensor
that decays has such a colour, and whitened residuals keep it. It says nothing against the plant if
it is the same whether the vehicle moves or rests: autocorrelations of rows at which it rests must
differ from zero (Ljung & Box 1978), and those of rows at which it moves must not differ from them,
by variances of Bartlett (1946).

The intervals are then made valid for it. With whitened derivatives J of the rows by the common
numbers and autocorrelations rho of the whitened residuals, the covariance is

    (J'J)^-1 (sum_k w_k rho_k sum_t J_t J_(t+k)') (J'J)^-1

in the place of (J'J)^-1, w the weights of Bartlett's window.

Such residuals may hide a plant that lacks more than a further lag, as one that overshoots: a
further lag with a zero is tried beside the noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime.estimation._native import ROUGH, FlightProfile, PlantNumbers
from deadtime.estimation.fit._residuals import SIGNIFICANCE
from deadtime.estimation.likelihood._air_at_rest import RESTS, SHOWS, rows_since_motion
from deadtime.estimation.likelihood._flight import NoiseFit, PlantModel
from deadtime.estimation.likelihood._free_numbers import numbers_of, plant_at
from deadtime.estimation.likelihood._profile import LikelihoodProfile

#: Autocorrelations that are compared, and the fewest pairs of rows of which each is known.
LAGS, FEWEST = 20, 50

#: Autocorrelations in the covariance.
WINDOW = 40

#: Step of difference quotients in times, in rows, and in the gain, as a share of it.
TIME_STEP, GAIN_STEP = 0.02, 1e-3

#: Starts of a further lag with a zero: the lag, and the zero over the lag, in rows.
OVERSHOOTS = ((2.0, 4.0), (8.0, 10.0))


@dataclass(frozen=True, eq=False)
class ColouredProfile(LikelihoodProfile):
    """The profile for residuals of this colour: `colour` are factors on the variances."""

    colour: Mapping[str, float] = field(default_factory=dict)

    def _native(self) -> FlightProfile:
        return super()._native().widened([self.colour[name] for name in self.names])


def coloured_profile(profile: LikelihoodProfile) -> ColouredProfile:
    """The same fit with intervals for the colour of its whitened residuals."""
    fit, names = profile.fit, profile.names
    return ColouredProfile(fit, names, profile.preferred, colour=_factors(profile))


def colour_at_rest(fit: NoiseFit, run: int) -> bool:
    """Whether the whitened residuals are coloured at rest, and not otherwise while it moves."""
    from scipy import special

    rows, part = fit.runs[run], fit.parts[run]
    since = rows_since_motion(rows, part, np.arange(rows.time.size))
    whitened = part.whitened / np.sqrt(np.mean(part.whitened[rows.used] ** 2))
    (moving, pairs), (resting, own) = (
        _autocorrelations(whitened, rows.used & mask) for mask in (since < SHOWS, since > RESTS)
    )
    if min(pairs.min(), own.min()) < FEWEST:
        return False
    p_value = float(special.chdtrc(LAGS, np.sum(own * resting**2)))
    spread = 1.0 + 2.0 * float(np.sum(resting**2))
    differ = np.sum((moving - resting) ** 2 / (1.0 / pairs + 1.0 / own)) / spread
    return p_value < SIGNIFICANCE < float(special.chdtrc(LAGS, differ))


def overshoots(fit: NoiseFit) -> tuple[PlantNumbers, float]:
    """The likeliest numbers with a further lag and a zero, and the probability of such a ratio.

    Two numbers more: half the distribution with one degree of freedom and half with two, since the
    lag is at its bound without them.
    """
    from scipy import special

    model = fit.model
    names = model.names if "zero" in model.names else (*model.names, "zero")
    richer = replace(fit, model=replace(model, extra=model.extra + 1, names=names))
    one, between = fit.numbers, fit.runs[0].row_time
    found = [
        richer.likelihood.fit(
            PlantNumbers(
                one.delay,
                [*one.lags, lag * between],
                one.noise,
                fit.gain,
                one.zero + zero * between,
            ),
            ROUGH,
        )
        for lag, zero in OVERSHOOTS
    ]
    best = min(found, key=lambda one: one.objective)
    rise = max(0.0, one.objective - best.objective)
    return best, 0.5 * float(special.chdtrc(1, rise) + special.chdtrc(2, rise))


def colour_of_squares(whitened: Array, direction: Array) -> float:
    """The variance of the squares of coloured residuals along a direction, over that of white ones.

    Squares of Gaussian rows have the squared autocorrelations.
    """
    shares = _tapered(whitened) ** 2
    size = direction.size
    products = np.array([direction[lag:] @ direction[: size - lag] for lag in range(shares.size)])
    return max(1.0, float(2.0 * shares @ products / products[0]) - 1.0)


def _tapered(whitened: Array) -> Array:
    """Autocorrelations up to `WINDOW`, that at zero first, in Bartlett's window."""
    lags = np.arange(min(WINDOW, whitened.size - 1) + 1)
    power = float(whitened @ whitened)
    found = [float(whitened[lag:] @ whitened[: whitened.size - lag]) / power for lag in lags]
    return np.asarray((1.0 - lags / (WINDOW + 1)) * np.array(found))


def _autocorrelations(whitened: Array, used: Mask) -> tuple[Array, Array]:
    """Autocorrelations of these rows, and the pairs of which each is known."""
    values = np.where(used, whitened, 0.0)
    power = float(np.sum(values**2)) / max(1, int(np.sum(used))) or 1.0
    pairs = np.array([np.sum(used[lag:] & used[:-lag]) for lag in range(1, LAGS + 1)])
    sums = np.array([values[lag:] @ values[:-lag] for lag in range(1, LAGS + 1)])
    return sums / np.maximum(pairs, 1) / power, pairs


def _factors(profile: LikelihoodProfile) -> dict[str, float]:
    """The variance of each quantity for coloured residuals, over that for white ones."""
    fit = profile.fit
    size = len(fit.model.order)
    plain, spread = np.zeros((size, size)), np.zeros((size, size))
    for run, rows in enumerate(fit.runs):
        columns = _columns(fit, run)[rows.used]
        plain = plain + columns.T @ columns
        spread = spread + columns.T @ columns
        for lag, share in enumerate(_tapered(fit.parts[run].whitened[rows.used])[1:], 1):
            product = columns[lag:].T @ columns[:-lag]
            spread = spread + share * (product + product.T)
    bread = np.linalg.pinv(plain, hermitian=True)
    both = bread @ spread @ bread
    return {
        name: max(1.0, float(weight @ both @ weight) / float(weight @ bread @ weight))
        for name, weight in zip(profile.names, np.array(profile.native.weights), strict=True)
    }


def _columns(fit: NoiseFit, run: int) -> Array:
    """Derivatives of the whitened rows by the common numbers: gain, delay, lags, zero."""
    # A gain that is not searched stays in its column.
    names = tuple(name for name in fit.model.names if name != "gain")
    model: PlantModel = replace(fit.model, names=names)
    likelihood = model.likelihood(fit.runs, fit.trim)
    now, step = numbers_of(fit), TIME_STEP * fit.runs[run].row_time

    def at(kernel: str, value: float) -> Array:
        part = likelihood.at(run, plant_at(fit, {kernel: value}))
        return np.asarray(part.whitened * np.sqrt(part.variance))

    found = []
    for name, kernel in fit.model.order:
        move = GAIN_STEP * abs(fit.gain) if kernel == "gain" else step
        # Times below zero are none.
        found.append((at(kernel, now[name] + 2.0 * move) - at(kernel, now[name])) / (2.0 * move))
    return np.stack(found, axis=1)
