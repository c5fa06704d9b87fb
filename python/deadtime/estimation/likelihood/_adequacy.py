"""Is the model adequate? Tests of a fit under the noise of a flight, at the 1 % level by default.

White residuals are not enough: the air can take the place of a lag that the plant lacks, and the
whitened residuals stay white. Beside their whiteness, these are tested:

* a further lag beside the noise: the likelihood ratio, half its distribution at zero (Self & Liang
  1987);
* a delay at its bound, zero: beyond it the likelihood may not rise (score test);
* a delay that is constant over the window (`delay_change`);
* air that is slower than the rows: faster air stands for something else;
* recordings that agree about gain, and delay and lag together (`contradictions`);
* air that moves the output as much while the vehicle rests (`air_at_rest`);
* where the residuals are not white, a colour that is the same while the vehicle rests, and neither
  a further lag with a zero beside the noise (`colour_at_rest`, `overshoots`);
* noise that does not grow with the speed of the output, as it does where time stamps are not the
  times of the samples (Breusch & Pagan 1979).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import stated
from deadtime.estimation._native import ROUGH, PlantNumbers, RowNoise
from deadtime.estimation.fit._residuals import SIGNIFICANCE, Whiteness, whiteness_of
from deadtime.estimation.likelihood._agreement import contradictions
from deadtime.estimation.likelihood._air_at_rest import air_at_rest
from deadtime.estimation.likelihood._changing_delay import NONE_SEEN, delay_change
from deadtime.estimation.likelihood._colour_at_rest import (
    colour_at_rest,
    colour_of_squares,
    overshoots,
)
from deadtime.estimation.likelihood._flight import NoiseFit
from deadtime.estimation.likelihood._profile import LikelihoodProfile
from deadtime.estimation.likelihood._rows import FlightRows, is_long

#: Starts of the further lag, in rows.
FURTHER = (0.7, 3.0)

#: Rise of −2 ln L that is small beside that of a lag that is significant.
CLEAR = 0.3

#: The further lag that counts as none, in rows.
NONE = 1e-3

#: Level at which a further lag may not move delay and lag together out of their interval.
MOVES = 0.05

#: Level of the test for a lag where air is found and the plant has none. The air takes the place of
#: such a lag so well that at 1 % the test misses one in twelve, and at 4 % one in twenty.
LEVEL_IN_AIR = 0.04

#: Most deviations of the sensor noise by which air that changes within a row may move the output.
RESTLESS = 15.0

#: Deviation of residuals, in that of rounding, up to which they are those of rounding.
MOST_ROUNDING = 1.5


@dataclass(frozen=True)
class Adequacy:
    """What the tests say.

    Attributes
    ----------
    whiteness : Whiteness
        Of the whitened residuals.
    further_lag : float
        The further lag that makes the recordings likeliest, s.
    reasons : tuple of str
        Why the model is not adequate; empty where it is.
    plant_lacks : bool
        Whether one of them is that the plant lacks something: a lag, or what the air stands for.
    coloured : bool
        Whether the whitened residuals have a colour that is there while the vehicle rests, too:
        then the intervals have to be made valid for it.
    """

    whiteness: Whiteness
    further_lag: float
    reasons: tuple[str, ...]
    plant_lacks: bool = False
    coloured: bool = False


def adequacy_of(profile: LikelihoodProfile, numbers: int, level: float = 0.95) -> Adequacy:
    """Test a fit of so many `numbers`."""
    fit = profile.fit
    used = [rows.used for rows in fit.runs]
    whitened = [part.whitened[mask] for part, mask in zip(fit.parts, used, strict=True)]
    whiteness = whiteness_of(np.concatenate(whitened), 0, [piece.size for piece in whitened])
    reasons = []
    rounded = all(
        rounding_explains(part.residuals[mask], rows)
        for part, mask, rows in zip(fit.parts, used, fit.runs, strict=True)
    )
    coloured = not (whiteness.white or rounded) and _has_colour_at_rest(profile)
    if not (whiteness.white or rounded or coloured):
        reasons.append(
            "the residuals are not white beside the fitted noise (lag-1 autocorrelation "
            f"{whiteness.autocorrelation:.2f})"
        )
    richer, p_value = further_lag(fit)
    further = richer.lags[-1]
    total = richer.delay + sum(richer.lags) - richer.zero + fit.model.own_lag
    plain = len(reasons)
    level_of_lag = _level_of_lag(fit)
    if p_value < level_of_lag:
        reasons.append(
            f"a further lag of {further:.3g} s makes the recording likelier: the plant lacks it"
        )
    elif p_value < MOVES and not _holds(profile, total, level):
        reasons.append(
            f"a further lag of {further:.3g} s would move delay and lag together to {total:.3g} s, "
            "out of their interval"
        )
    elif coloured and (one := overshoots(fit))[1] < SIGNIFICANCE:
        reasons.append(
            f"a further lag of {one[0].lags[-1]:.3g} s with a zero of {one[0].zero:.3g} s makes "
            "the recording likelier: the plant lacks them"
        )
    if below_zero(fit) < SIGNIFICANCE:
        reasons.append(
            "the delay is at zero, and below zero the recording would be likelier: the plant lags "
            "more than the vehicle, or lacks something"
        )
    # Between the levels there is doubt, and the fit is the best there is all the same.
    doubted = SIGNIFICANCE <= p_value < level_of_lag
    lacks = len(reasons) > plain + doubted
    for index, part in enumerate(fit.parts):
        where = f" in recording {index + 1}" if len(fit.parts) > 1 else ""
        # Commands that follow from the plant move with its numbers, which the test does not know.
        change = delay_change(fit, index) if profile.commands_given else NONE_SEEN
        if change.p_value < SIGNIFICANCE:
            reasons.append(
                f"the delay is not constant over the window{where}: it changes by "
                f"{stated(change.spread, math.nan, 's')} (standard deviation)"
            )
        mask = used[index]
        if grows_with_speed(part.whitened[mask], part.rate[mask], coloured) < SIGNIFICANCE:
            reasons.append(
                f"the noise grows with the speed of the output{where}, as where time stamps are "
                "not the times of the samples"
            )
        if (share := restless_air(fit, index)) > RESTLESS:
            reasons.append(
                f"the air found{where} changes within a row and moves the output {share:.2g} times "
                "the noise of the sensor, as no air does: it stands for something else"
            )
            lacks = True
        if air_at_rest(fit, index) < SIGNIFICANCE:
            reasons.append(
                f"what is taken for air{where} moves the output more while the vehicle moves than "
                "while it rests: the plant lacks something"
            )
            lacks = True
    reasons += contradictions(profile)
    return Adequacy(whiteness, further, tuple(reasons), lacks, coloured)


def _level_of_lag(fit: NoiseFit) -> float:
    """Level of the test for a further lag."""
    has_lag = any(fit.numbers.lags) or fit.model.own_lag > 0.0
    in_air = any(noise.air > 0.0 for noise in fit.numbers.noise)
    return LEVEL_IN_AIR if in_air and not has_lag else SIGNIFICANCE


def _has_colour_at_rest(profile: LikelihoodProfile) -> bool:
    """Whether what is not white is noise with a colour, for which the intervals can be made valid.

    That is known of plain profiles alone, and of recordings that are not long.
    """
    fit = profile.fit
    plain = type(profile) is LikelihoodProfile and not is_long(fit.runs)
    return plain and all(colour_at_rest(fit, run) for run in range(len(fit.runs)))


def rounding_explains(residuals: Array, rows: FlightRows) -> bool:
    """Whether these residuals are those of rounding, which is not white: it follows the output."""
    return float(np.std(residuals)) < MOST_ROUNDING * rows.rounding / math.sqrt(12.0)


def restless_air(fit: NoiseFit, run: int) -> float:
    """How far air that changes within a row moves the output, in deviations of sensor noise."""
    noise, rows = fit.numbers.noise[run], fit.runs[run]
    if not fit.model.integrates or noise.air_time > rows.row_time:
        return 0.0
    time = rows.time
    moved = noise.air * math.sqrt(2.0 * noise.air_time * float(time[-1] - time[0]))
    return moved / math.hypot(1.0, noise.sensor)


def _holds(profile: LikelihoodProfile, total: float, level: float) -> bool:
    """Whether the interval of delay and lags together holds a value."""
    name = next((name for name in profile.names if name.startswith("delay+")), None)
    if name is None:
        return True
    low, high = profile.interval(name, total, 0.0, level)
    return low <= total <= high


def further_lag(fit: NoiseFit) -> tuple[PlantNumbers, float]:
    """The likeliest numbers with a further lag, and the probability of such a ratio without.

    In long recordings the noise stays as it is.
    """
    from scipy import special

    richer = replace(fit, model=replace(fit.model, extra=fit.model.extra + 1))
    likelihood = richer.likelihood
    between = fit.runs[0].row_time
    one, long = fit.numbers, is_long(fit.runs)

    def behind(lag: float, noise: Sequence[RowNoise]) -> PlantNumbers:
        delay = max(one.delay - lag * between, 0.0)
        return PlantNumbers(delay, [*one.lags, lag * between], noise, fit.gain, one.zero)

    without = behind(NONE, one.noise)
    least = (
        likelihood.objective(without)
        if long
        else likelihood.held(without, f"lag {len(fit.model.free_lags)}", NONE * between).objective
    )
    noises = [one.noise]
    if not long and any(noise.air > 0.0 for noise in one.noise):
        noises.append([RowNoise()] * len(one.noise))
    found = [
        likelihood.fit(behind(lag, noise), CLEAR if long else ROUGH, noise=not long)
        for noise in noises
        for lag in (FURTHER[:1] if long else FURTHER)
    ]
    best = min(found, key=lambda one: one.objective)
    if best.objective >= least:
        return without, 1.0
    return best, 0.5 * float(special.chdtrc(1, least - best.objective))


def below_zero(fit: NoiseFit) -> float:
    """Probability of such a slope of the likelihood at a delay of zero, which is its bound."""
    from scipy import special

    if "delay" not in fit.model.names or fit.numbers.delay > 0.0:
        return 1.0
    slopes = [float(part.score @ part.whitened) for part in fit.parts if part.score.size]
    size = abs(math.fsum(slopes)) / math.sqrt(max(1, len(slopes)))
    return float(special.ndtr(-size))


def grows_with_speed(whitened: Array, rate: Array, coloured: bool = False) -> float:
    """Probability of squares that grow so much with the squared speed, for equal variances."""
    from scipy import special

    squares, speed = whitened**2, rate**2
    speed = speed - speed.mean()
    power = float(speed @ speed)
    if power == 0.0:
        return 1.0
    slope = float(speed @ squares) / power
    # The variance of the square of a Gaussian of variance one is two.
    wider = colour_of_squares(whitened, speed) if coloured else 1.0
    return float(0.5 * special.erfc(slope * math.sqrt(power / wider) / 2.0))
