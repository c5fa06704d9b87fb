"""Bootstrap of step responses: the same network, with the step at other times.

The plant knows when the answer to every measurement arrived. With these times the loop is simulated
again, exactly, for a step at another time of the same recording. The delay that a method estimates
from such a step, minus the mean age of a command, is its error. This error includes the few random
delays within one step, bursts of losses, and the error of the method itself. The network is the
measured one; the uncertainty of its mean, an average of few bursts, is added as a normal error
(`age_error`).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation import dominant_x, exact_x
from deadtime.links.udp import HeldIntegrator, Trial

#: Functions from the overshoot to K·Td, by the names of the replayed methods.
MAPS: dict[str, Callable[[float], float]] = {"dominant": dominant_x, "exact": exact_x}

#: Segments of the measured times whose means are taken as independent.
SEGMENTS = 20

#: Bootstrap samples for an interval.
DRAWS = 4000


def answer_times(arrivals: Sequence[tuple[int, float]]) -> Array:
    """Time from each measurement to its answer, s, in the order of the measurements.

    From the first to the last answered measurement; infinite where no answer came.
    """
    if not arrivals:
        return np.empty(0)
    numbers, ages = zip(*arrivals, strict=True)
    times = np.full(max(numbers) - min(numbers) + 1, np.inf)
    times[np.array(numbers) - min(numbers)] = ages
    return times


def age_error(times: Array, sample_time: float) -> float:
    """Standard error of the mean age over these answers, s, from its means over segments."""
    samples = np.arange(times.size)
    answered = np.isfinite(times)
    arrived = samples[answered] + np.ceil(times[answered] / sample_time - 1e-9).astype(int)
    newest = np.full(times.size, -1)
    inside = arrived < times.size
    np.maximum.at(newest, arrived[inside], samples[answered][inside])
    newest = np.maximum.accumulate(newest)
    ages = (samples - newest)[newest >= 0] * sample_time
    if ages.size < 2 * SEGMENTS:
        return math.nan
    means = [float(np.mean(part)) for part in np.array_split(ages, SEGMENTS)]
    return float(np.std(means, ddof=1)) / math.sqrt(SEGMENTS)


def replayed_errors(
    trial: Trial, times: Array, age: float, count: int, seed: int = 0
) -> dict[str, Array]:
    """Errors of the delays from `count` replayed steps against the mean age, s.

    Parameters
    ----------
    trial : Trial
        The loop.
    times : ndarray
        Times from `answer_times`.
    age : float
        The mean age of the measurement behind the command in force, s.
    count : int
        Steps to replay, at random times drawn with `seed`.

    Returns
    -------
    dict of str to ndarray
        For each of `MAPS`, without the steps whose overshoot determines no delay.
    """
    applied = np.array([_applied(trial, time) for time in times.tolist()])
    shifts = np.random.default_rng(seed).integers(times.size, size=count)
    overshoots = [_overshoot(trial, np.roll(applied, -int(shift))) for shift in shifts]
    found = {}
    for name, mapped in MAPS.items():
        errors = []
        for value in overshoots:
            try:
                errors.append(mapped(value) / (trial.gain * trial.plant_gain) - age)
            except NotIdentifiableError:
                continue
        found[name] = np.array(errors)
    return found


def interval_of_mean(
    mean: float, errors: Sequence[Array], error: float, level: float = 0.95, seed: int = 0
) -> tuple[float, float]:
    """Interval of the mean age from the mean of runs with these errors, one array a run.

    `error` is the standard error of the mean age to which the errors refer, s. NaN where a run has
    too few errors.
    """
    outside = 0.5 * (1.0 - level)
    if not errors or min(sample.size for sample in errors) < 2.0 / outside or math.isnan(error):
        return math.nan, math.nan
    random = np.random.default_rng(seed)
    drawn = np.mean([random.choice(sample, DRAWS) for sample in errors], axis=0)
    drawn += error * random.standard_normal(DRAWS)
    low, high = np.quantile(drawn, [outside, 1.0 - outside]).tolist()
    return mean - high, mean - low


def _applied(trial: Trial, age: float) -> float:
    """Time from a measurement until its command of this age is applied, s."""
    if not age <= trial.watchdog:
        return math.inf
    wait = trial.policy.wait(age)
    return math.inf if wait is None else age + wait


def _overshoot(trial: Trial, times: Array) -> float:
    """Overshoot of a unit step at the first of these measurements."""
    plant = HeldIntegrator(trial.plant_gain, trial.lag)
    samples = math.floor((trial.duration - trial.rest) / trial.sample_time)
    holds = trial.policy.holds
    hold, then = trial.watchdog, trial.safe
    if holds is not None and holds * trial.sample_time < hold:
        hold, then = holds * trial.sample_time, 0.0
    in_transit: list[tuple[float, int, float]] = []
    command, newest, clock, peak = 0.0, -1, 0.0, 0.0
    released = math.inf
    delays = np.resize(times, samples).tolist()

    def until(now: float) -> None:
        nonlocal clock, command, released
        if released < now:
            plant.advance(released - clock, command)
            clock, command, released = released, then, math.inf
        plant.advance(now - clock, command)
        clock = now

    for number, delay in enumerate(delays):
        now = number * trial.sample_time
        while in_transit and in_transit[0][0] <= now:
            arrival, answered, value = heapq.heappop(in_transit)
            until(arrival)
            if answered > newest:
                command, newest, released = value, answered, arrival + hold
        until(now)
        peak = max(peak, plant.output)
        if math.isfinite(delay):
            requested = trial.gain * (1.0 - plant.output)
            value = max(-trial.limit, min(trial.limit, requested))
            heapq.heappush(in_transit, (now + delay, number, value))
    return peak - 1.0
