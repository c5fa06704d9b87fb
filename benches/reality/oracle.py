"""Estimates by one who knows how the recordings were made, beside the bound.

A bound need not be attained: a delay without a lag has an effect that is not smooth, and commands
are few. The oracle maximises the likelihood of the process that made a run. It knows the parts of
the noise and their sizes, or, of `unknown` noise, the parts alone, and starts at the truth, so that
no search fails. It uses nothing of `deadtime`. No method can be asked for more than it reaches.

It knows of a run what is in its log. Commands in rows that are missing follow from the controller's
law, and the reference may have changed at each missing row before the first that has another one.
Its intervals are those of the likelihood ratio.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy import linalg, optimize, special

from reality.bound import STEP, bounds, covariance, linearised, outputs, response
from reality.conditions import Condition
from reality.generator import Array, Mask, Run, record

#: The grid over the delay: its points, half its width in bounds at first, how often it is made
#: narrower, and by how much. The likelihood has kinks and several maxima.
POINTS, REACH, ROUNDS, NARROWER = 25, 6.0, 3, 8.0

#: Most steps of Gauss and Newton for the other numbers, and the step that is none.
STEPS, SETTLED = 5, 1e-7

#: Rounds of mean and noise in turn, where the noise is unknown.
TURNS = 3

#: Shortest lag, s, and the level of the intervals.
SHORTEST, LEVEL = 0.003, 0.95


class OracleRun(NamedTuple):
    """Errors of delay, gain and delay + lag, whether their intervals hold the truth, the bounds."""

    errors: tuple[float, ...]
    held: tuple[bool, ...]
    bounds: tuple[float, float]


class Fit(NamedTuple):
    """-2 ln L without constants, and the numbers."""

    objective: float
    values: dict[str, float]


#: The fit with some numbers held.
Fits: TypeAlias = Callable[[Mapping[str, float]], Fit]


def oracle_estimate(condition: Condition, number: int, unknown: bool = False) -> OracleRun:
    """Fit run `number` of the condition, and compare with the truth."""
    run = record(condition, number)
    vehicle = run.vehicle
    least = bounds(condition, run, condition.free)
    truth = {"delay": vehicle.delay, "gain": vehicle.gain, "sum": vehicle.delay + sum(vehicle.lags)}
    fits = [fit_of(condition, run, one, least[0], unknown) for one in references(run)]
    best = min((fit({}) for fit in fits), key=lambda one: one.objective)
    found = best.values | {"sum": best.values["delay"] + best.values.get("lag", 0.0)}
    rise = float(special.chdtri(1, 1.0 - LEVEL))
    held = tuple(
        min(fit({name: true}).objective for fit in fits) - best.objective <= rise
        for name, true in truth.items()
    )
    return OracleRun(tuple(found[name] - true for name, true in truth.items()), held, least)


def references(run: Run) -> Iterator[Run]:
    """The run with each reference that its log allows: one step, at a sample."""
    change = int(np.argmax(run.reference != 0.0))
    first = int(np.flatnonzero(run.logged[:change])[-1]) + 1
    last = change + int(np.argmax(run.logged[change:]))
    for at in range(first, last + 1):
        after = np.arange(run.times.size) >= at
        yield replace(run, reference=np.where(after, run.vehicle.step, 0.0))


def fit_of(condition: Condition, run: Run, assumed: Run, width: float, unknown: bool) -> Fits:
    """The function that fits the run as if it were `assumed`, around the truth."""
    names = ["gain", "level", *["lag"] * condition.lag, *["trim"] * bool(condition.trim)]
    mean = Mean(assumed, run.logged & ~run.outlying, tuple(names))
    if condition.quantum:
        return partial(likeliest, mean, partial(rounded_fit, condition, mean), width)
    J, V = linearised(condition, run, ["delay", *names])
    if not unknown:
        return partial(likeliest, mean, partial(gaussian_fit, mean, whitener_of(V)[0]), width)
    return partial(fit_with_noise, Shape(condition, run, J), mean, width)


@dataclass(frozen=True)
class Mean:
    """The mean output in the rows `seen`, by the delay and the numbers `names`."""

    run: Run
    seen: Mask
    names: tuple[str, ...]

    @property
    def measured(self) -> Array:
        return self.run.measured[self.seen]

    def at(self, numbers: Mapping[str, Array]) -> Array:
        """The mean for each of some points; without noise in rows that were not logged."""
        vehicle = self.run.vehicle
        path = vehicle.gain * response(
            self.run.times, self.run.arrivals, self.run.command, vehicle.lags
        )
        true = {"delay": vehicle.delay, "gain": vehicle.gain, "lag": sum(vehicle.lags)}
        changed = {name: values - true.get(name, 0.0) for name, values in numbers.items()}
        noise = np.zeros((len(changed["delay"]), int(np.sum(~self.run.logged))))
        return outputs(replace(self.run, path=path, measured=path), changed, noise)[:, self.seen]

    def start(self, delays: Array) -> dict[str, Array]:
        """The truth, with these delays."""
        vehicle = self.run.vehicle
        true = {"gain": vehicle.gain, "lag": sum(vehicle.lags)}
        return {"delay": delays} | {
            name: np.full(delays.size, true.get(name, 0.0)) for name in self.names
        }


#: -2 ln L at some points, and the points, where all but the names that are fixed have been fitted.
FitAt: TypeAlias = Callable[[dict[str, Array], set[str]], tuple[Array, dict[str, Array]]]


def likeliest(mean: Mean, fit_at: FitAt, width: float, held: Mapping[str, float]) -> Fit:
    """The likeliest numbers, some held, over a grid of the delay that becomes narrower."""
    held = dict(held)
    if "lag" not in mean.names and "sum" in held:
        held["delay"] = held.pop("sum")
    centre, reach, best = mean.run.vehicle.delay, REACH * width, Fit(math.inf, {})
    rounds = 1 if "delay" in held else ROUNDS
    for _ in range(rounds):
        delays = centre + np.linspace(-reach, reach, POINTS)
        delays = np.array([held["delay"]]) if "delay" in held else delays[delays >= 0.0]
        if "sum" in held:
            delays = delays[delays < held["sum"] - SHORTEST]
        start = mean.start(delays)
        start |= {"gain": np.full(delays.size, held["gain"])} if "gain" in held else {}
        start |= {"lag": held["sum"] - delays} if "sum" in held else {}
        fixed = {"delay", *held} | ({"lag"} if "sum" in held else set())
        objective, points = fit_at(start, fixed)
        i = int(np.argmin(objective))
        if objective[i] < best.objective:
            best = Fit(float(objective[i]), {name: float(one[i]) for name, one in points.items()})
        centre, reach = best.values["delay"], reach / NARROWER
    return best


def gaussian_fit(
    mean: Mean, whitener: Array, points: dict[str, Array], fixed: set[str]
) -> tuple[Array, dict[str, Array]]:
    """Least squares of whitened rows at each point, in the numbers that are not fixed."""
    free = [name for name in points if name not in fixed]
    count = len(points["delay"])
    for _ in range(STEPS):
        moved = [{**points, name: points[name] + STEP} for name in free]
        every = {
            name: np.concatenate([points[name], *(one[name] for one in moved)]) for name in points
        }
        found = (mean.at(every) @ whitener.T).reshape(1 + len(free), count, -1)
        left = whitener @ mean.measured - found[0]
        slopes = np.moveaxis((found[1:] - found[0]) / STEP, 0, -1)
        step = np.einsum("pij,pj->pi", np.linalg.pinv(slopes), left)
        points = dict(points)
        for i, name in enumerate(free):
            points[name] = points[name] + step[:, i]
        if "lag" in free:
            points["lag"] = np.maximum(points["lag"], SHORTEST)
        if np.max(np.abs(step), initial=0.0) < SETTLED:
            break
    left = whitener @ mean.measured - mean.at(points) @ whitener.T
    return np.sum(left**2, axis=1), points


def rounded_fit(
    condition: Condition, mean: Mean, points: dict[str, Array], fixed: set[str]
) -> tuple[Array, dict[str, Array]]:
    """Likelihood of the intervals in which the rounded rows were, in the same numbers.

    It is concave in gain and level.
    """
    free = [name for name in points if name not in fixed]
    unit = mean.at({**points, "gain": np.ones_like(points["gain"]), "level": 0.0 * points["level"]})
    columns = {"gain": unit, "level": np.ones_like(unit)}
    objective, points = np.empty(len(unit)), {name: one.copy() for name, one in points.items()}
    for i in range(len(unit)):
        known = sum(points[name][i] * columns[name][i] for name in columns if name in fixed)
        design = np.stack([columns[name][i] for name in free], axis=1)

        def cost(x: Array, known: Array = known, design: Array = design) -> tuple[float, Array]:
            value, slope = rounded_likelihood(condition, mean.measured, known + design @ x)
            return value, slope @ design

        start = linalg.lstsq(design, mean.measured - known)[0]
        found = optimize.minimize(cost, start, jac=True, method="BFGS")
        objective[i] = found.fun
        for name, value in zip(free, found.x, strict=True):
            points[name][i] = value
    return objective, points


def rounded_likelihood(condition: Condition, measured: Array, mean: Array) -> tuple[float, Array]:
    """-2 ln L of rounded rows, and its derivatives by the mean."""
    half = condition.quantum / 2.0
    # Of both signs, take that of the smaller probabilities: their logarithms are exact.
    away = np.abs(measured - mean)
    low, high = (-away - half) / condition.white, (-away + half) / condition.white
    upper = special.log_ndtr(high)
    log = upper + np.log1p(-np.exp(special.log_ndtr(low) - upper))
    density = [np.exp(-(z**2) / 2.0 - log) / math.sqrt(2.0 * math.pi) for z in (high, low)]
    slope = -2.0 * (density[0] - density[1]) / condition.white
    return -2.0 * float(np.sum(log)), slope * np.sign(measured - mean)


def whitener_of(V: Array) -> tuple[Array, float]:
    """The inverse of the lower factor of V, and ln det V."""
    factor = linalg.cholesky(V, lower=True)
    whitener = linalg.solve_triangular(factor, np.eye(len(V)), lower=True)
    return whitener, 2.0 * float(np.sum(np.log(np.diag(factor))))


@dataclass(frozen=True)
class Shape:
    """V up to its size, by the logarithms of the ratios and times that it has."""

    condition: Condition
    run: Run
    J: Array

    @property
    def start(self) -> Array:
        one = self.condition
        if one.gust is not None:
            return np.log(one.gust)
        if one.correlation:
            return np.array([math.log(one.white), special.logit(one.correlation)])
        return np.log([one.air]) if one.air else np.empty(0)

    def at(self, logs: Array, lag: float | None = None) -> Array:
        """V, where the air passes through the true lag or this one."""
        one, run = self.condition, self.run
        if lag is not None:
            run = replace(run, vehicle=replace(run.vehicle, lags=(lag,)))
        if one.gust is not None:
            deviation, time = np.exp(logs)
            one = replace(one, gust=(float(deviation), float(time)))
        elif one.correlation:
            one = replace(
                one, white=float(np.exp(logs[0])), correlation=float(special.expit(logs[1]))
            )
        elif one.air:
            one = replace(one, air=float(np.exp(logs[0])))
        seen = self.run.logged & ~self.run.outlying
        return covariance(one, run)[np.ix_(seen, seen)]

    def objective(self, V: Array, left: Array, columns: Array | None = None) -> float:
        """-2 ln L of residuals of an unknown size, less what the columns explain of them.

        The numbers of the mean are taken out of the likelihood.
        """
        whitener, log_det = whitener_of(V)
        white, slopes = whitener @ left, whitener @ self.J
        if columns is not None:
            design = whitener @ columns
            white = white - design @ linalg.lstsq(design, white)[0]
        rows, count = self.J.shape
        log_det += float(np.linalg.slogdet(slopes.T @ slopes)[1])
        return (rows - count) * math.log(float(np.sum(white**2))) + log_det


def fit_with_noise(shape: Shape, mean: Mean, width: float, held: Mapping[str, float]) -> Fit:
    """Mean and noise in turn: each has little effect on the other, unless air passes a lag."""
    logs = shape.start
    fit = Fit(math.inf, {})
    for _ in range(TURNS):
        whitener = whitener_of(shape.at(logs))[0]
        fit = likeliest(mean, partial(gaussian_fit, mean, whitener), width, held)
        point = {name: np.array([value]) for name, value in fit.values.items()}
        left = mean.measured - mean.at(point)[0]
        if logs.size:
            logs = searched(lambda x, left=left: shape.objective(shape.at(x), left), logs).x
        fit = Fit(shape.objective(shape.at(logs), left), fit.values)
    if "lag" in mean.names and logs.size:
        short = {"lag": 2.0 * SHORTEST, "delay": fit.values["delay"] + fit.values["lag"]}
        starts = (fit.values, fit.values | short)
        return min(
            (fit_together(shape, mean, start, logs, width, held) for start in starts),
            key=lambda one: one.objective,
        )
    return fit


def fit_together(
    shape: Shape,
    mean: Mean,
    start: Mapping[str, float],
    logs: Array,
    width: float,
    held: Mapping[str, float],
) -> Fit:
    """Mean and noise at once: the air shows the lag that it passes."""
    count = logs.size
    has_delay = "delay" not in held
    gain = held.get("gain")

    def times(x: Array) -> tuple[float, float]:
        delay = x[count] * width if has_delay else held["delay"]
        return delay, held["sum"] - delay if "sum" in held else math.exp(x[-1])

    def moved(x: Array, gain: float) -> Array:
        delay, lag = times(x)
        one = {"delay": delay, "lag": lag, "gain": gain, "level": 0.0}
        return mean.at({name: np.array([value]) for name, value in one.items()})[0]

    def linear(x: Array) -> tuple[Array, Array]:
        """What gain and level have to explain, and their columns."""
        path = moved(x, 1.0 if gain is None else gain)
        ones = np.ones((path.size, 1))
        if gain is None:
            return mean.measured, np.column_stack([path, ones])
        return mean.measured - path, ones

    def cost(x: Array) -> float:
        delay, lag = times(x)
        if delay < 0.0 or lag < SHORTEST:
            return math.inf
        return shape.objective(shape.at(x[:count], lag), *linear(x))

    first = [*logs, *[start["delay"] / width] * has_delay]
    first += [math.log(start["lag"])] if "sum" not in held else []
    found = searched(cost, np.array(first))
    x = found.x
    delay, lag = times(x)
    left, columns = linear(x)
    whitener = whitener_of(shape.at(x[:count], lag))[0]
    slopes = linalg.lstsq(whitener @ columns, whitener @ left)[0]
    gain_there = float(slopes[0]) if gain is None else gain
    values = {"delay": delay, "lag": lag, "gain": gain_there, "level": float(slopes[-1])}
    return Fit(float(found.fun), values)


def searched(cost: Callable[[Array], float], start: Array) -> optimize.OptimizeResult:
    """The minimum by Nelder and Mead's method."""
    simplex = start + np.vstack([np.zeros(start.size), 0.5 * np.eye(start.size)])
    with np.errstate(all="ignore"):
        return optimize.minimize(
            cost,
            start,
            method="Nelder-Mead",
            options={"xatol": 0.02, "fatol": 0.01, "initial_simplex": simplex},
        )
