"""What the bank of filters is given before the first row, and what it then knows at each row."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import between
from deadtime._base.validation import interval, non_negative
from deadtime._base.verdicts import Verdict, claimed, verdict_if
from deadtime.estimation._native import BankAnswer, FlightPlant
from deadtime.estimation._plant import Disturbance, disturbances_of, plant_model
from deadtime.experiments import FlightNoise
from deadtime.loops import ControlLoop

#: Number of delays and of lags in a range without a number.
DELAYS, LAGS = 50, 5

#: Time constant that stands for air that walks, s.
SLOW = 100.0

#: Deviation of a trim, in the trim that was fitted.
OF_TRIM = 3.0

#: Seconds of an hour.
HOUR = 3600.0

#: False alarms come so many times more seldom than the bound on their rate says, as measured over
#: 100 simulated hours (docs/theory/measured-estimates.md): the walk of the filters covers what
#: chance does, and the sum passes its threshold by more than nothing.
SELDOM = 4.0

#: The second bank has a delay in so many seconds where the first has more.
COARSE = 0.01


class BankSettings(NamedTuple):
    """The settings of the kernel, by its names."""

    plant: FlightPlant
    delays: list[float]
    follow: bool
    layers: list[tuple[list[float], float, list[float]]]
    gain: tuple[float, float]
    memory: float
    drift: float
    gain_walk: float
    width: float
    alarm: float
    every: int
    at_rest: bool
    level: float
    freedom: float
    white: float = 1.0
    trim: float = 0.0
    disturbances: Sequence[Disturbance] = ()

    def under(self, noise: FlightNoise) -> BankSettings:
        """The settings for this noise."""
        if noise.white <= 0.0:
            raise ValueError(
                f"noise={noise!r} contains no white noise: give a standard deviation above zero"
            )
        return self._replace(
            white=noise.white,
            trim=OF_TRIM * abs(noise.trim),
            disturbances=disturbances_of(noise, SLOW),
        )


def is_range(given: Any) -> bool:
    """Whether these are (low, high) or (low, high, n), not the points themselves."""
    return not isinstance(given, np.ndarray) and len(given) <= 3


def points_of_range(name: str, given: Any, number: int) -> Array:
    """The points of (low, high) or (low, high, n), or those given."""
    if not is_range(given):
        return np.asarray(given, dtype=float)
    if len(given) == 3:
        number = int(given[2])
    low, high = interval(name, tuple(given[:2]))
    if low < 0.0:
        raise ValueError(f"{name}={given!r}: give times of zero or more")
    if number < 3:
        raise ValueError(f"{name}={given!r}: give three or more points")
    return np.linspace(low, high, number)


def linear_plant(loop: ControlLoop, names: tuple[str, ...]) -> FlightPlant:
    """The plant as the kernel takes it."""
    if not loop.plant.is_linear:
        raise ValueError(
            f"the plant {loop.plant!r} is not linear, but the filters need a linear plant: give "
            "the plant without its limits, and give commands that already follow the limits"
        )
    return plant_model(loop.plant, names)


def lag_sets(model: FlightPlant, lags: Array | None) -> list[list[float]]:
    """The lags of each layer: those of the plant, the first of them replaced by each of `lags`."""
    if lags is None:
        return [list(model.lags)]
    if not model.lags:
        raise ValueError(
            "lags= needs a plant with a lag: give Integrator(lag=…), FirstOrder or FactoredPlant"
        )
    return [[float(lag), *model.lags[1:]] for lag in lags]


def alarm_of(false_alarms_per_hour: float) -> float:
    """Mean time between the false alarms that the sum of a change is held against, s."""
    rate = non_negative("false_alarms_per_hour", false_alarms_per_hour)
    return HOUR / (SELDOM * rate) if rate else math.inf


def coarser(delays: Array) -> int:
    """Every how many of these delays the second bank has one."""
    return max(1, round(COARSE / float(np.median(np.diff(delays)))))


#: From how many deviations the product of neighbouring innovations shows that they are not white.
#: The test is repeated all the time, so that its level is about one in a hundred thousand.
COLOURED = 4.5

#: Covariance of innovations and commands that shows that the model lacks something: of χ² with six
#: degrees, about one in a million.
UNEXPLAINED = 38.0

#: Probability of the last delay of a range from which the delay may be beyond.
AT_END = 0.1

#: White noise so many times the one that was given or fitted is another noise.
LOUDER = 3.0

#: So many changes within a minute, in s, are not those of a delay.
RESTLESS, MINUTE = 3, 60.0

#: Share of the range that an interval must be narrower than, to be an estimate.
NARROWER = 0.5


@dataclass(frozen=True, slots=True)
class OnlineEstimate:
    """The delay of a loop at one row, from that row and all before.

    Attributes
    ----------
    time : float
        Of the row, s.
    delay : float
        Posterior mean of the delay now, s. While there is no estimate yet, the middle of the range.
    ci : (float, float)
        Interval of the delay now, s: 95 % unless the estimator was told otherwise.
    stderr : float
        Posterior standard deviation of the delay, s.
    lag : float
        Posterior mean of the lags of the plant together, s.
    delay_plus_lag : float
        Posterior mean of delay and lags together, s.
    delay_plus_lag_ci : (float, float)
        Its interval, s.
    gain : float
        Posterior mean of the gain of the plant.
    gain_stderr : float
        Its posterior standard deviation.
    informed : bool
        Whether the last seconds told something about the delay: the command changed enough.
    changed : bool
        Whether a change of the delay, a jump and not a drift, was found at this row.
    known : bool
        Whether there is an estimate: the interval is narrower than half the range of delays.
    verdict : {"reliable", "indication", "none"}
        Whether the rows of the last half minute agree with the model; ``"none"`` while there is no
        estimate.
    message : str
        Why there is no estimate yet, or why it is not reliable.
    """

    time: float
    delay: float
    ci: tuple[float, float]
    stderr: float
    lag: float
    delay_plus_lag: float
    delay_plus_lag_ci: tuple[float, float]
    gain: float
    gain_stderr: float
    informed: bool
    changed: bool
    known: bool
    verdict: Verdict
    message: str

    def to_dict(self) -> dict[str, Any]:
        """All numbers, as plain values for JSON."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
        }

    def __str__(self) -> str:
        text = f"{self.time:.2f} s: {self.verdict}"
        if self.known:
            text += f": delay {claimed(self.verdict, self.delay, self.stderr, 's')}"
        if self.verdict == "reliable":
            text += f", 95 %: {between(*self.ci, self.stderr, 's')}"
        return f"{text}; {self.message}" if self.message else text


def is_restless(changes: int) -> bool:
    """Whether so many changes within a minute are more than a delay has."""
    return changes >= RESTLESS


def estimate_of(
    numbers: BankAnswer,
    white: float,
    range_: tuple[float, float],
    doubts: Sequence[str] = (),
    changes: int = 0,
) -> OnlineEstimate:
    """The estimate of the kernel's answer, after so many changes in a minute.

    `white` is the noise that was expected, and `doubts` are why the model did not hold before.
    """
    against = [*doubts]
    if abs(numbers.colour) > COLOURED:
        against.append(
            "the innovations are not white, so the noise differs "
            "from the given noise, or the plant model is incomplete"
        )
    if numbers.unexplained > UNEXPLAINED:
        against.append("the innovations follow the command, so the plant model is incomplete")
    if numbers.highest > AT_END:
        against.append(f"the delay may exceed the longest that is tried, {range_[1]:.3g} s")
    if numbers.lowest > AT_END and range_[0] > 0.0:
        against.append(f"the delay may be below the shortest that is tried, {range_[0]:.3g} s")
    if numbers.white > LOUDER * white:
        against.append(f"the noise is {numbers.white / white:.1f} times the expected noise")
    if is_restless(changes):
        against.append(f"{changes} changes in a minute, so the plant model is incomplete")
    known = numbers.high - numbers.low < NARROWER * (range_[1] - range_[0])
    message = "; ".join(f"not reliable: {reason}" for reason in against)
    if not known:
        waits = (
            "the command has not changed enough yet"
            if numbers.started
            else "with the longest possible delay the first command has not reached the plant yet"
        )
        message = f"no estimate yet: {waits}" + (f"; {message}" if message else "")
    return OnlineEstimate(
        **numbers.shown,
        known=known,
        verdict=verdict_if(not against) if known else "none",
        message=message,
    )
