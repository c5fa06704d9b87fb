"""Gains that follow the delay beside the robust ones, on flights whose delay moves.

The delay of the commands goes from 0.1 to 0.5 s and back, in ramps, while the reference steps up
and down, in gusts and with noise of the sensor (`reality.generator`). Each flight is flown twice
with the same draws: with the robust gains, and with those that a schedule takes from the interval
of the delay. The vehicle is simulated at the exact arrivals of its commands.

``python benches/adaptation.py`` flies 200 flights of 200 s and prints their
mean absolute errors; ``--quick`` 20 flights. ``--oracle`` gives the schedule the true delay of some
seconds ago in place of the online estimate.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import deadtime as dtm
import numpy as np
from deadtime.estimation import OnlineEstimator
from deadtime.experiments import FlightNoise
from deadtime.tuning import GainSchedule, adaptive_gains
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))
from reality.conditions import Condition
from reality.generator import air_response

Array = NDArray[np.float64]

SAMPLE, LIMIT = 0.065, 1.0

#: The vehicle, and how far its gain may be from what the schedule was told.
GAIN, LAG, SPREAD = 0.885, 0.1, 0.04

#: The kind of controller; its filter is that of the client.
CONTROLLER = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0, discretisation="tustin"))

#: Delays, s; the times at the first, of a ramp, at the other, of the ramp back, and at the end.
DELAYS, PARTS = (0.1, 0.5), (60.0, 60.0, 60.0, 60.0, 60.0)

#: Time between two steps of the reference, their sizes, and the height that they begin from.
HOLD, STEPS, BASE = 8.0, (0.25, 0.75), 1.0

#: Deviation of the delay of single commands, s.
JITTER = 0.003

#: The air and the sensor.
GUSTS = Condition("adaptation", gust=(0.05, 1.0), white=0.005)

#: What ends a flight: an error above 1.5 steps and a margin, or such heights, m.
GROWTH, MARGIN, HEIGHTS = 1.5, 0.1, (0.2, 3.0)

#: Of the online estimator: delays, how much the delay wanders, s/√s, and the level of intervals.
RANGE, DRIFT, LEVEL = (0.0, 0.65), 0.01, 0.999

#: Commands that may be on their way or in force.
IN_FLIGHT = 16

#: From the interval of the delay at each time: (number of the sample, outputs, commands) to bounds.
Interval = Callable[[int, Array, Array], tuple[Array, Array, NDArray[np.bool_]]]


@dataclass(frozen=True)
class Draws:
    """What happens in the flights, whatever the gains are; a column for each."""

    gain: Array
    delay: Array
    arrival: Array
    reference: Array
    step: Array
    air: Array
    noise: Array

    @property
    def times(self) -> Array:
        return SAMPLE * np.arange(len(self.delay))


@dataclass(frozen=True)
class Flown:
    """Mean absolute errors, m, whether a flight went outside a limit, and, at each sample of each
    flight, the set in use and whether its interval held the delay, so that the proof applied.
    """

    error: Array
    outside: NDArray[np.bool_]
    sets: NDArray[np.int64]
    covered: NDArray[np.bool_]


def drawn(count: int, parts: tuple[float, ...] = PARTS) -> Draws:
    """The draws of so many flights, each from its own number."""
    columns = [_drawn_one(np.random.default_rng([22, i]), parts) for i in range(count)]
    gain, delay, arrival, reference, step, air, noise = map(np.array, zip(*columns, strict=True))
    return Draws(gain, delay.T, arrival.T, reference.T, step, air.T, noise.T)


def _drawn_one(random: np.random.Generator, parts: tuple[float, ...]) -> tuple[float | Array, ...]:
    times = SAMPLE * np.arange(round(sum(parts) / SAMPLE))
    turns = np.cumsum((0.0, *parts)) + random.uniform(-5.0, 5.0)
    low, high = DELAYS
    delay = np.interp(times, turns, (low, low, high, high, low, low))
    late = delay + np.abs(JITTER * random.standard_normal(times.size))
    step = random.uniform(*STEPS) * random.choice([-1.0, 1.0])
    up = np.floor((times + random.uniform(0.0, HOLD)) / HOLD) % 2.0
    reference = BASE + abs(step) + np.where(up > 0.0, step, 0.0)
    reference -= reference[0]
    return (
        GAIN * random.uniform(1.0 - SPREAD, 1.0 + SPREAD),
        delay,
        np.maximum.accumulate(times + late),
        reference,
        abs(step),
        air_response(GUSTS, LAG, times, random),
        GUSTS.white * random.standard_normal(times.size),
    )


def response(passed: Array) -> tuple[Array, Array]:
    """Position and velocity after a time of unit speed demanded, for a gain of one."""
    rising = -np.expm1(-passed / LAG) if LAG else np.ones_like(passed)
    return passed - LAG * rising, rising


def flown(draws: Draws, schedule: GainSchedule, interval: Interval | None) -> Flown:
    """Fly with the robust gains, or with those that follow the interval of the delay."""
    from deadtime.loops._derivative_filter import discretised

    rows, count = draws.delay.shape
    proof = schedule.proof
    factors = np.array([one.factor for one in schedule.sets])
    omega, damping, rule = proof.filter or (38.0, 1.0, "tustin")
    into = np.array([0.0, omega])
    smooth = discretised(
        np.array([[0.0, omega], [-omega, -2.0 * damping * omega]]), into, into, SAMPLE, rule
    )
    followers = [schedule.follow() for _ in range(count)]
    moved, speed, filtered = np.zeros(count), np.zeros(count), np.zeros((2, count))
    commands = np.zeros((rows, count))
    error, outside = np.zeros(count), np.zeros(count, dtype=bool)
    sets = np.full((rows, count), len(factors) - 1)
    for k in range(rows):
        path = moved + draws.air[k]
        output = path + draws.noise[k]
        if k == 0:
            filtered[0] = output
        slope = smooth.C @ filtered + smooth.D * output
        filtered = smooth.F @ filtered + smooth.G[:, None] * output
        if interval is not None:
            low, high, known = interval(k, output, commands)
            for i, follower in enumerate(followers):
                now = float(draws.times[k]), float(low[i]), float(high[i])
                sets[k, i] = follower.update(*now, bool(known[i])).number
        factor = factors[sets[k]]
        wanted = factor * (proof.Kp * (draws.reference[k] - output) - proof.Kv * slope)
        commands[k] = np.clip(wanted, -LIMIT, LIMIT)
        away = draws.reference[k] - path
        error += np.abs(away) / rows
        outside |= np.abs(away) > GROWTH * draws.step + MARGIN
        height = path + BASE + draws.step
        outside |= (height < HEIGHTS[0]) | (height > HEIGHTS[1])

        # Over the next sample: every command from its arrival to that of the next one.
        first = max(0, k + 1 - IN_FLIGHT)
        begin = np.clip(draws.arrival[first : k + 1] - draws.times[k], 0.0, SAMPLE)
        end = np.vstack([begin[1:], np.full((1, count), SAMPLE)])
        positions, velocities = (
            a - b for a, b in zip(response(SAMPLE - begin), response(SAMPLE - end), strict=True)
        )
        rising = -math.expm1(-SAMPLE / LAG) if LAG else 1.0
        moved = moved + LAG * rising * speed
        speed = (1.0 - rising) * speed
        recent = draws.gain * commands[first : k + 1]
        moved = moved + (positions * recent).sum(axis=0)
        speed = speed + (velocities * recent).sum(axis=0)
    longest = np.array([one.delays[1] for one in schedule.sets])
    return Flown(error, outside, sets, draws.delay <= longest[sets])


def oracle(draws: Draws, late: float = 3.0, deviation: float = 0.006) -> Interval:
    """The true delay some seconds ago, with an error, and an interval of 3.3 deviations."""
    random = np.random.default_rng(7)
    keep = math.exp(-SAMPLE / 5.0)
    wrong = np.zeros(draws.delay.shape[1])

    def interval(k: int, output: Array, commands: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        nonlocal wrong
        shock = deviation * math.sqrt(1.0 - keep**2) * random.standard_normal(wrong.size)
        wrong = keep * wrong + shock
        middle = draws.delay[max(0, k - round(late / SAMPLE))] + wrong
        known = np.full(wrong.size, k * SAMPLE > 10.0)
        return middle - 3.3 * deviation, middle + 3.3 * deviation, known

    return interval


def online(draws: Draws) -> Interval:
    """The interval of an online estimator for each flight, which is told the model of the noise."""
    noise = FlightNoise(white=GUSTS.white, air=GUSTS.gust[0], air_time=GUSTS.gust[1])
    loop = dtm.ControlLoop(dtm.Integrator(GAIN, lag=LAG), dtm.P(1.0), sample_time=SAMPLE)
    estimators = [
        OnlineEstimator(
            loop,
            delays=RANGE,
            noise=noise,
            gain=(GAIN, SPREAD * GAIN),
            drift=DRIFT,
            level=LEVEL,
        )
        for _ in range(draws.delay.shape[1])
    ]

    def interval(k: int, output: Array, commands: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        now = float(draws.times[k])
        found = []
        for i, estimator in enumerate(estimators):
            if k > 0:
                estimator.command(float(draws.times[k - 1]), float(commands[k - 1, i]))
            found.append(estimator.update(now, float(output[i])))
        low, high = np.array([one.ci for one in found]).T
        known = np.array([one.known and one.verdict == "reliable" for one in found])
        return low, high, known

    return interval


def made_schedule(
    controller: dtm.P | dtm.PV = CONTROLLER, delays: tuple[float, float] = (0.0, 0.58)
) -> GainSchedule:
    """A schedule for the flights, which is not told the gain of any."""
    plant = dtm.Integrator(GAIN, lag=LAG)
    loop = dtm.ControlLoop(plant, controller, sample_time=SAMPLE, limit=LIMIT)
    gain = (GAIN * (1.0 - SPREAD), GAIN * (1.0 + SPREAD))
    return adaptive_gains(loop, delays, gain=gain, sets=8)


def main() -> None:
    """Fly both ways and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="20 flights in place of 200")
    parser.add_argument("--oracle", action="store_true", help="the true delay of 3 s ago")
    options = parser.parse_args()
    begin = time.perf_counter()
    schedule = made_schedule()
    print(schedule.summary())
    print(f"found and checked in {time.perf_counter() - begin:.0f} s")
    draws = drawn(20 if options.quick else 200)
    fixed = flown(draws, schedule, None)
    source = oracle if options.oracle else online
    adaptive = flown(draws, schedule, source(draws))
    ratio = adaptive.error / fixed.error
    print(f"{len(ratio)} flights of {sum(PARTS):g} s")
    print(
        f"mean absolute error, median: {1e3 * np.median(fixed.error):.1f} mm with robust gains, "
        f"{1e3 * np.median(adaptive.error):.1f} mm with gains that follow"
    )
    print(f"ratio: median {np.median(ratio):.3f}, least {ratio.min():.3f}, most {ratio.max():.3f}")
    print(
        f"time in which the interval of the set held the delay: "
        f"{100.0 * adaptive.covered.mean():.2f} %"
    )
    print(f"outside limits: {fixed.outside.sum()} and {adaptive.outside.sum()}")
    shares = [float(np.mean(adaptive.sets == i)) for i in range(len(schedule.sets))]
    print("time in each set: " + ", ".join(f"{100.0 * share:.0f} %" for share in shares))
    changes = np.count_nonzero(np.diff(adaptive.sets, axis=0), axis=0)
    print(f"changes of the set in a flight: median {np.median(changes):.0f}, most {changes.max()}")


if __name__ == "__main__":
    main()
