"""What a step would have shown at another moment of the same network.

The ends know when the answer to every measurement came. With these times the loop is run again,
exactly, for a step that comes at another moment of them; what a method reads from such steps,
less the mean age of a command, is how far it misses. This has all of what makes it miss in it: the
few delays that a step meets, the losses that come together, the error of the method itself. It is
a bootstrap over the moment of the step, with the network as it was measured; that the measured
mean is itself one of few bursts is added as a normal error (`age_error`).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation.methods._overshoot import dominant_x, exact_x
from deadtime.links.udp import HeldIntegrator, Trial

__all__ = ["MAPS", "age_error", "answer_times", "interval_of_mean", "replayed_errors"]

Array = NDArray[np.float64]

#: From overshoot to K·Td, by the names of the methods that are replayed.
MAPS: dict[str, Callable[[float], float]] = {"dominant": dominant_x, "exact": exact_x}

#: Stretches of the measured times whose means are taken as independent.
STRETCHES = 20

#: Means of the runs that are drawn for an interval.
DRAWS = 4000


def answer_times(arrivals: Sequence[tuple[int, float]]) -> Array:
    """How long each measurement's answer took, s, in the order of the measurements.

    Infinite where none came; from the first to the last that was answered.
    """
    if not arrivals:
        return np.empty(0)
    numbers, ages = zip(*arrivals, strict=True)
    times = np.full(max(numbers) - min(numbers) + 1, np.inf)
    times[np.array(numbers) - min(numbers)] = ages
    return times


def age_error(times: Array, sample_time: float) -> float:
    """Standard error of the mean age over these answers, s: by how much its stretches differ."""
    samples = np.arange(times.size)
    came = np.isfinite(times)
    arrived = samples[came] + np.ceil(times[came] / sample_time - 1e-9).astype(int)
    newest = np.full(times.size, -1)
    inside = arrived < times.size
    np.maximum.at(newest, arrived[inside], samples[came][inside])
    newest = np.maximum.accumulate(newest)
    ages = (samples - newest)[newest >= 0] * sample_time
    if ages.size < 2 * STRETCHES:
        return math.nan
    means = [float(np.mean(part)) for part in np.array_split(ages, STRETCHES)]
    return float(np.std(means, ddof=1)) / math.sqrt(STRETCHES)


def replayed_errors(
    trial: Trial, times: Array, age: float, count: int, seed: int = 0
) -> dict[str, Array]:
    """By how much the delays of `count` replayed steps miss the mean age, s.

    Parameters
    ----------
    trial : Trial
        The loop.
    times : ndarray
        When each measurement was answered, as of `answer_times`.
    age : float
        The mean age of the measurement behind the command in force, s.
    count : int
        Steps to replay, at moments drawn by `seed`.

    Returns
    -------
    dict of str to ndarray
        For each of `MAPS`; steps whose overshoot says nothing are left out.
    """
    applied = np.array([_applied(trial, one) for one in times.tolist()])
    moments = np.random.default_rng(seed).integers(times.size, size=count)
    overshoots = [_overshoot(trial, np.roll(applied, -int(moment))) for moment in moments]
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
    """Interval of the mean age from the mean of runs that miss like these errors, one array a run.

    `error` is that of the mean age the errors are counted from, s. NaN where the errors of a run
    are too few to say.
    """
    outside = 0.5 * (1.0 - level)
    if not errors or min(one.size for one in errors) < 2.0 / outside or math.isnan(error):
        return math.nan, math.nan
    random = np.random.default_rng(seed)
    drawn = np.mean([random.choice(one, DRAWS) for one in errors], axis=0)
    drawn += error * random.standard_normal(DRAWS)
    low, high = np.quantile(drawn, [outside, 1.0 - outside]).tolist()
    return mean - high, mean - low


def _applied(trial: Trial, age: float) -> float:
    """When a command of this age is applied, counted from its measurement, s."""
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
    under_way: list[tuple[float, int, float]] = []
    command, newest, clock, peak = 0.0, -1, 0.0, 0.0
    let_go = math.inf
    trips = np.resize(times, samples).tolist()

    def until(now: float) -> None:
        nonlocal clock, command, let_go
        if let_go < now:
            plant.advance(let_go - clock, command)
            clock, command, let_go = let_go, then, math.inf
        plant.advance(now - clock, command)
        clock = now

    for number, trip in enumerate(trips):
        now = number * trial.sample_time
        while under_way and under_way[0][0] <= now:
            arrival, answered, value = heapq.heappop(under_way)
            until(arrival)
            if answered > newest:
                command, newest, let_go = value, answered, arrival + hold
        until(now)
        peak = max(peak, plant.output)
        if math.isfinite(trip):
            wanted = trial.gain * (1.0 - plant.output)
            value = max(-trial.limit, min(trial.limit, wanted))
            heapq.heappush(under_way, (now + trip, number, value))
    return peak - 1.0
