"""How well faults of a recording can be detected at all.

Estimates of commands that were lost, of a delay that changes and of a plant that lacks a lag should
be called indications. Here the best test does that: the likelihood ratio (Neyman & Pearson 1933) by
one who knows the noise and how large such faults are. Delay, gain and level, and a lag that is
fitted, are unknown to it too. Its power is the share of recordings with the fault in which it finds
it, where one in ten without is called faulty as well: more than that may not be, because nine in
ten good recordings have to be reliable. No method finds more.

What is left of the rows after these numbers are fitted, in white deviations, is z: the residuals in
the complement of their derivatives. Without a fault z is white and of variance one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from scipy import linalg, optimize, special

from reality.bound import linearised, response
from reality.conditions import Condition
from reality.generator import Array, Run, ramp, record
from reality.oracle import whitener_of

#: Share of good recordings that may be called faulty.
LEVEL = 0.1

#: Draws of z, with the fault and without, for each run whose power has no closed form.
DRAWS = 200

#: Commands whose loss has the largest effects are lost or not in every combination; so many draws
#: of the losses of all others.
LARGEST, REST = 9, 32


def power(condition: Condition, runs: int) -> float:
    """Share of recordings with the fault of a condition in which the best test finds it."""
    records = (record(condition, number) for number in range(runs))
    if condition.delay_ramp:
        return _known(_length(_later(run), condition, run) for run in records)
    if condition.lag:
        return _known(_length_of_lag(condition, run) for run in records)
    ratios = [
        (_ratios_of_losses if condition.commands_lost else _ratios_of_wander)(condition, run, i)
        for i, run in enumerate(records)
    ]
    none, fault = (np.concatenate(one) for one in zip(*ratios, strict=True))
    return float(np.mean(fault > np.quantile(none, 1.0 - LEVEL)))


def has_power(condition: Condition) -> bool:
    """Whether a condition is one of these faults, beside noise that is known here."""
    lacks_lag = condition.second_lag or (condition.lag and "lag" not in condition.free)
    return bool(
        condition.delay_ramp or condition.delay_wander or condition.commands_lost or lacks_lag
    )


def _known(lengths: Iterator[float]) -> float:
    """Power where the mean of z is known up to its size: that of a Gaussian."""
    limit = special.ndtri(1.0 - LEVEL)
    return float(np.mean([special.ndtr(length - limit) for length in lengths]))


def _length(effect: Array, condition: Condition, run: Run) -> float:
    """Length of the mean of z for such an effect on the rows."""
    return float(np.linalg.norm(_complement(condition, run) @ effect))


def _complement(condition: Condition, run: Run) -> Array:
    """What turns residuals of all rows into z."""
    J, V = linearised(condition, run, ["delay", "gain", "level"])
    whitener, _ = whitener_of(V)
    basis = linalg.qr(whitener @ J)[0][:, J.shape[1] :]
    seen = run.logged & ~run.outlying
    return np.asarray(basis.T @ whitener @ np.eye(seen.size)[seen])


def _by_arrival(run: Run) -> Array:
    """Change of each row by the time at which each command arrives, for a plant without lag."""
    vehicle = run.vehicle
    arrivals = run.times + vehicle.delay
    jumps = np.diff(run.command, prepend=0.0)
    return -vehicle.gain * (run.times[:, None] > arrivals) * jumps


def _later(run: Run) -> Array:
    """What the delays of a run, in place of one delay, change in its rows."""
    vehicle = run.vehicle
    either = [
        response(run.times, arrivals, run.command, ())
        for arrivals in (run.arrivals, run.times + vehicle.delay)
    ]
    return np.asarray(vehicle.gain * (either[0] - either[1]))


def _length_of_lag(condition: Condition, run: Run) -> float:
    """Distance of the response with all lags from the nearest with one less."""
    vehicle = run.vehicle
    _, V = linearised(condition, run, ["delay", "gain", "level"])
    whitener, _ = whitener_of(V)
    truth = whitener @ response(run.times, run.arrivals, run.command, vehicle.lags)
    jumps = np.diff(run.command, prepend=0.0)
    fitted = vehicle.lags[:-1]

    def left(point: Array) -> float:
        if np.any(point <= 0.0):
            return math.inf
        unit = ramp(run.times[:, None] - run.times - point[0], point[1:].tolist()) @ jumps
        columns = whitener @ np.stack([unit, np.ones_like(unit)], axis=1)
        return float(np.linalg.norm(truth - columns @ np.linalg.lstsq(columns, truth)[0]))

    # The delay, or the lags, take the place of the one that is left out, or share it.
    more = vehicle.lags[-1] * np.linspace(0.0, 1.5, 31)
    starts = [np.array([vehicle.delay + one, *fitted]) for one in more]
    if fitted:
        starts += [np.array([vehicle.delay, *(one + lag for lag in fitted)]) for one in more]
    best = min(starts, key=left)
    sizes = 0.1 * vehicle.lags[-1] * np.eye(best.size)
    options = {"initial_simplex": np.vstack([best, best + sizes]), "xatol": 1e-5, "fatol": 1e-4}
    found = optimize.minimize(left, best, method="Nelder-Mead", options=options)
    return vehicle.gain * float(found.fun)


def _ratios_of_wander(condition: Condition, run: Run, number: int) -> tuple[Array, Array]:
    """Likelihood ratios of z without and with delays that wander, in drawn recordings."""
    random = np.random.default_rng([1, number])
    effects = _complement(condition, run) @ _by_arrival(run)
    apart = np.abs(run.times[:, None] - run.times)
    shape = condition.delay_wander**2 * np.exp(-apart)
    variances = np.maximum(linalg.eigvalsh(effects @ shape @ effects.T), 0.0)
    squares = random.chisquare(1.0, (2, DRAWS, variances.size))
    squares[1] *= 1.0 + variances
    none, fault = squares @ (variances / (1.0 + variances)) - np.sum(np.log1p(variances))
    return none, fault


def _ratios_of_losses(condition: Condition, run: Run, number: int) -> tuple[Array, Array]:
    """The same for commands that were lost; the command before is held then."""
    random = np.random.default_rng([2, number])
    vehicle, share = run.vehicle, condition.commands_lost
    age = np.maximum(run.times[:, None] - run.times - vehicle.delay, 0.0)
    later = np.append(age[:, 1:], np.zeros((run.times.size, 1)), axis=1)
    jumps = np.diff(run.command, prepend=0.0)
    effects = _complement(condition, run) @ (-vehicle.gain * jumps * (age - later))
    order = np.argsort(-np.linalg.norm(effects, axis=0))
    chosen = np.array(list(itertools.product((0.0, 1.0), repeat=LARGEST)))
    rest = (random.random((REST, order.size - LARGEST)) < share).astype(float)
    lost = np.empty((len(chosen), REST, order.size))
    lost[:, :, order[:LARGEST]] = chosen[:, None]
    lost[:, :, order[LARGEST:]] = rest
    lost = lost.reshape(-1, order.size)
    count = np.repeat(chosen.sum(axis=1), REST)
    prior = count * math.log(share) + (LARGEST - count) * math.log1p(-share) - math.log(REST)
    moved = lost @ effects.T
    prior -= 0.5 * np.sum(moved**2, axis=1)
    z = random.standard_normal((2, DRAWS, len(effects)))
    z[1] += (random.random((DRAWS, order.size)) < share) @ effects.T
    none, fault = special.logsumexp(z @ moved.T + prior, axis=2)
    return none, fault


def print_powers(conditions: list[Condition], runs: int, processes: int) -> None:
    """Print the power of the best test for each condition that has one."""
    faults = [one for one in conditions if has_power(one)]
    print(f"{'':24}found by the best test, % (of good recordings {100.0 * LEVEL:.0f} %)")
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        for one, found in zip(faults, pool.map(power, faults, [runs] * len(faults)), strict=True):
            print(f"{one.name:24}{100.0 * found:10.0f}", flush=True)
