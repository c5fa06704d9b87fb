"""What `OnlineEstimator` and `lagd`'s scheme achieve on the same runs."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import deadtime as dtm
import numpy as np
from deadtime.estimation import OnlineEstimator
from deadtime.estimation.running._bank import COLOURED, UNEXPLAINED
from deadtime.experiments import FlightNoise

from tracking import lagd
from tracking.bound import posterior_bound, window_bound
from tracking.runs import SAMPLE, Array, Runs, Vehicle, arrived, fly, references, walks

#: Rows that are left out at the start, s.
SETTLED = 10.0

#: The 50 delays of the runs in which changes are looked for: about the bound of five seconds apart.
FINE = (0.15, 0.45, 50)

#: Changes in bounds of five seconds, and the time within which they are to be found.
CHANGE, SPELL = 6.0, 5.0

#: Largest jump that the range holds, s.
LARGEST = 0.14

#: Of the walk where the delay is constant but for jumps, s/√s.
CALM = 0.0003

#: Numbers of an answer of the bank that are looked at, and their places.
NAMES = ("delay", "low", "high", "changed", "colour", "unexplained")
PLACES = {name: place for place, name in enumerate(NAMES)}


numbers = attrgetter(*NAMES)


@dataclass(frozen=True)
class Tracked:
    """The numbers of the bank, one array of shape (runs, rows) a name."""

    numbers: Array

    def __getattr__(self, name: str) -> Array:
        return self.numbers[:, :, PLACES[name]]

    @property
    def reliable(self) -> Array:
        """Whether innovations are white and do not follow the command."""
        return (abs(self.colour) < COLOURED) & (self.unexplained < UNEXPLAINED)


def tracked(runs: Runs, **options: object) -> Tracked:
    """The estimates over all runs, with the noise that made them."""
    vehicle = runs.vehicle
    plant = dtm.Integrator(vehicle.gain, lag=vehicle.lag)
    loop = dtm.ControlLoop(plant, dtm.P(vehicle.Kp), sample_time=SAMPLE)
    noise = FlightNoise(white=vehicle.white, air=vehicle.gust, air_time=vehicle.gust_time)
    found = []
    for output, command in zip(runs.output, runs.command, strict=True):
        estimator = OnlineEstimator(loop, noise=noise, at_rest=True, **options)
        bank = estimator._bank
        assert bank is not None
        rows = []
        for time, value, sent in zip(runs.time, output, command, strict=True):
            rows.append(numbers(bank.row(time, value)))
            bank.command(time, sent)
        found.append(rows)
    return Tracked(np.array(found))


@dataclass(frozen=True)
class DriftScore:
    """Errors of the delay in s, over all runs and rows but the first."""

    rmse: float
    bound: float
    bias: float
    coverage: float
    reliable: float

    def __str__(self) -> str:
        return (
            f"RMSE {1e3 * self.rmse:.1f} ms, bound {1e3 * self.bound:.1f} ms, ratio "
            f"{self.rmse / self.bound:.2f}, bias {1e3 * self.bias:+.1f} ms, coverage "
            f"{self.coverage:.1%}, reliable {self.reliable:.1%}"
        )


def drifts(
    count: int, duration: float = 200.0, intensity: float = 0.014, kind: str = "walk", seed: int = 5
) -> DriftScore:
    """Delays that drift from 0.2 to 0.4 s, as a walk between these or evenly."""
    random = np.random.default_rng(seed)
    rows = int(duration / SAMPLE)
    delay = (
        walks(count, rows, 0.2, 0.4, intensity, random)
        if kind == "walk"
        else np.tile(np.linspace(0.2, 0.4, rows), (count, 1))
    )
    runs = fly(Vehicle(), delay, references(count, rows, random), random)
    first = np.array([0.0, 1.0, runs.vehicle.gust, 0.4, 0.17])
    bound = posterior_bound(runs, intensity, first)
    found = tracked(runs, drift=intensity, delays=(0.02, 0.72, 50))
    truth = arrived(runs)
    part = slice(int(SETTLED / SAMPLE), None)
    error = (found.delay - truth)[:, part]
    inside = ((found.low <= truth) & (truth <= found.high))[:, part]
    return DriftScore(
        rmse=float(np.sqrt(np.mean(error**2))),
        bound=float(np.sqrt(np.mean(bound[:, part] ** 2))),
        bias=float(np.mean(error)),
        coverage=float(np.mean(inside)),
        reliable=float(np.mean(found.reliable)),
    )


@dataclass(frozen=True)
class ChangeScore:
    """Jumps of the delay: their median size, s, how many were found in time, and how late."""

    size: float
    in_time: float
    median: float

    def __str__(self) -> str:
        return (
            f"jumps of {1e3 * self.size:.0f} ms: {self.in_time:.0%} within {SPELL:g} s of the "
            f"first command with the new delay, median {self.median:.1f} s"
        )


def changes(count: int, up: bool = True, seed: int = 7) -> ChangeScore:
    """Jumps by six times the bound of five seconds of the data, after a minute without one.

    Runs whose command hardly changes in these five seconds are left out: the jump would be beyond
    the range of the filters.
    """
    rows, at = int(90.0 / SAMPLE), int(60.0 / SAMPLE)
    reference = references(count, rows, np.random.default_rng(seed))
    delay = np.full((count, rows), 0.3)
    still = fly(Vehicle(), delay, reference, np.random.default_rng(seed + 1))
    first = at + int(0.3 / SAMPLE)
    sizes = CHANGE * window_bound(still, first, first + int(SPELL / SAMPLE))
    excited = sizes < LARGEST
    new = 0.3 + np.where(excited, sizes if up else -sizes, 0.0)
    delay[:, at:] = new[:, None]
    runs = fly(Vehicle(), delay, reference, np.random.default_rng(seed + 1))
    found = tracked(runs, drift=CALM, delays=FINE).changed > 0.0
    late = []
    for one, after in zip(found, new, strict=True):
        times = runs.time[one] - runs.time[at] - after
        late.append(min(times[times > 0.0], default=np.inf))
    late, sizes = np.array(late)[excited], sizes[excited]
    return ChangeScore(
        float(np.median(sizes)), float(np.mean(late <= SPELL)), float(np.median(late))
    )


@dataclass(frozen=True)
class CalmScore:
    """Hours without a change: false alarms, coverage, and the largest error, s."""

    hours: float
    alarms: int
    coverage: float
    worst: float
    reliable: float

    def __str__(self) -> str:
        return (
            f"{self.alarms} false alarms in {self.hours:.3g} h, coverage {self.coverage:.1%}, "
            f"largest error {1e3 * self.worst:.0f} ms, reliable {self.reliable:.2%}"
        )


def calm(hours: float, seed: int = 9) -> CalmScore:
    """A constant delay, hour by hour; the command changes all the time."""
    alarms, coverage, worst, reliable = 0, [], [], []
    each = min(hours, 1.0)
    rows = int(3600.0 * each / SAMPLE)
    for hour in range(round(hours / each)):
        random = np.random.default_rng([seed, hour])
        delay = np.full((1, rows), 0.3)
        runs = fly(Vehicle(), delay, references(1, rows, random), random)
        found = tracked(runs, drift=CALM, delays=FINE)
        part = slice(int(SETTLED / SAMPLE), None)
        alarms += int(np.sum(found.changed))
        coverage.append(np.mean(((found.low <= 0.3) & (found.high >= 0.3))[:, part]))
        worst.append(np.max(abs(found.delay - 0.3)[:, part]))
        reliable.append(np.mean(found.reliable))
    return CalmScore(
        hours, alarms, float(np.mean(coverage)), float(max(worst)), float(np.mean(reliable))
    )


def quiet(count: int, spell: float = 1200.0, seed: int = 11) -> tuple[float, float, float]:
    """A long spell in which the reference rests, between two minutes of changes.

    The largest error in the spell and after it, s, and the share of rows in the spell whose
    interval holds the delay.
    """
    random = np.random.default_rng(seed)
    minute, rows = int(60.0 / SAMPLE), int((120.0 + spell) / SAMPLE)
    reference = references(count, rows, random)
    reference[:, minute:-minute] = 0.0
    runs = fly(Vehicle(), np.full((count, rows), 0.3), reference, random)
    found = tracked(runs, drift=0.003, delays=(0.0, 0.6, 50))
    error = abs(found.delay - 0.3)
    inside = (found.low <= 0.3) & (found.high >= 0.3)
    return (
        float(np.max(error[:, minute:-minute])),
        float(np.max(error[:, -minute:])),
        float(np.mean(inside[:, minute:-minute])),
    )


@dataclass(frozen=True)
class Beside:
    """One estimator where the delay jumps from 0.25 to 0.35 s: of delay + lag, s."""

    name: str
    bias: float
    spread: float
    latency: float

    def __str__(self) -> str:
        return (
            f"{self.name:<26} bias {1e3 * self.bias:+6.1f} ms, spread {1e3 * self.spread:5.1f} ms, "
            f"half of a jump after {self.latency:.1f} s"
        )


def beside_lagd(count: int, duration: float = 600.0, seed: int = 13) -> list[Beside]:
    """Bias and spread before the jump, and when half of it is shown in the median run."""
    random = np.random.default_rng(seed)
    rows, at = int(duration / SAMPLE), int(0.5 * duration / SAMPLE)
    delay = np.full((count, rows), 0.25)
    delay[:, at:] = 0.35
    runs = fly(Vehicle(), delay, references(count, rows, random), random)
    lag = runs.vehicle.lag
    ours = tracked(runs, drift=0.001)
    theirs = [lagd.track(*pair, least=0.5) for pair in zip(runs.output, runs.command, strict=True)]
    shown = {
        "OnlineEstimator": ours.together,
        "correlation over 60 s": np.array([peaks for _, peaks in theirs]),
        "mean of its blocks": np.array([mean for mean, _ in theirs]),
    }
    found = []
    for name, values in shown.items():
        before = values[:, at - int(20.0 / SAMPLE) : at]
        late = []
        for one in values[:, at:]:
            passed = np.flatnonzero(one > np.nanmean(before) + 0.05)
            late.append(passed[0] * SAMPLE if passed.size else np.inf)
        error = before - 0.25 - lag
        found.append(
            Beside(name, float(np.nanmean(error)), float(np.nanstd(error)), float(np.median(late)))
        )
    return found
