"""What a fit reaches that knows the noise, and every structure that the plant may have.

It fits the true plant, those with a lag or a zero more, and those with fewer, each from the true
numbers. The interval is the hull over all within `REACH` of the best in BIC, as for the estimator.
The noise and its size are known, and nothing else is searched. Its width over that of the right
plant is the price of a structure that is not known. Rows are without faults. Kinds whose noise
passes a filter are left out, because the fits are for white noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from reality.table import pool_of

from strangers.least_squares import Data, data_of, fitted, response, standard_errors, vector
from strangers.linear import Array, Linear
from strangers.plants import Kind, Runs, drawn
from strangers.simulate import logged
from strangers.truth import HALF_WIDTH, OTHERS, QUANTITIES, best

#: Distance in BIC up to which a structure counts.
REACH = 10.0

#: A further lag or zero begins at this share of the delay.
FURTHER = 0.1


def structures(linear: Linear, kind: Kind) -> Iterator[Linear]:
    """Starts of all fits, the true plant first."""
    yield linear
    lags, zeros = linear.lags.shape[1], linear.zeros.shape[1]
    pairs, limited = linear.pairs.shape[1] // 2, bool(np.isfinite(linear.acceleration).all())
    further = FURTHER * kind.numbers["delay"][0] * np.ones((len(linear), 1))
    slowest_first = -np.sort(-linear.lags, axis=1)
    all_lags = np.concatenate([slowest_first, further], axis=1)
    all_zeros = np.concatenate([linear.zeros, further], axis=1)
    for count in range(lags if limited else 0, lags + 2):
        for places in range(zeros + 2):
            proper = places < count + pairs + linear.integrators
            if (count, places) == (lags, zeros) or not proper or places > count + pairs:
                continue
            rest = all_lags[:, count:lags].sum(axis=1)
            yield replace(
                linear,
                delay=linear.delay + rest,
                lags=all_lags[:, :count],
                zeros=all_zeros[:, :places],
            )


def criterion(linear: Linear, data: Data, deviation: Array) -> Array:
    """BIC of these plants where the size of the noise is known."""
    goal = data.outputs - data.outputs.mean(axis=1, keepdims=True)
    squares = ((goal - response(linear, data)) ** 2).sum(axis=1) / deviation**2
    numbers = vector(linear, data.kind).shape[1]
    return np.asarray(squares + numbers * math.log(data.outputs.shape[1]))


def hull(runs: Runs, omega: Array) -> tuple[Array, Array]:
    """Ends of the intervals of ln gain, equivalent delay and ln largest gain; each (runs, 3)."""
    logs = logged(runs)
    data = data_of(runs.kind, runs.dt, logs.command, logs.output)
    costs, lows, highs = [], [], []
    for start in structures(runs.linear, runs.kind):
        found = fitted(start, data)
        half = HALF_WIDTH * standard_errors(found, data, runs.deviation, omega)
        costs.append(criterion(found, data, runs.deviation))
        lows.append(found.felt(omega) - half)
        highs.append(found.felt(omega) + half)
    within = np.array(costs) <= np.min(costs, axis=0) + REACH
    low = np.where(within[:, :, None], lows, np.inf)
    high = np.where(within[:, :, None], highs, -np.inf)
    return low.min(axis=0), high.max(axis=0)


def ratios(kind: Kind, seed: int, which: range) -> tuple[Array, Array]:
    """Widths over those of the right plant, and whether the truth lies outside; each (runs, 3)."""
    runs = drawn(kind, [f"{seed} {kind.name}: clean {number}" for number in which])
    omega = runs.linear.crossover()
    low, high = hull(runs, omega)
    clean = logged(runs)
    data = data_of(kind, runs.dt, clean.command, clean.output)
    right = HALF_WIDTH * standard_errors(runs.linear, data, runs.deviation, omega)
    truths = [runs.linear.felt(omega)]
    if np.isfinite(runs.linear.acceleration).any():
        none = np.zeros(len(runs))
        truths += [best(runs, None, none, omega, time) for time in range(1, OTHERS + 1)]
    outside = (high < np.min(truths, axis=0)) | (low > np.max(truths, axis=0))
    return 0.5 * (high - low) / right, outside


def print_strangers_oracle(kinds: list[Kind], runs: int, seed: int, processes: int) -> None:
    """Print median widths over those of the right plant, and how often the truth is outside."""
    print(f"{'clean':20}" + "".join(f"{name:>16}{'outside':>9}" for name in QUANTITIES))
    with pool_of(processes) as pool:
        kinds = [kind for kind in kinds if not kind.filtered]
        waiting = [pool.submit(ratios, kind, seed, range(runs)) for kind in kinds]
        for kind, one in zip(kinds, waiting, strict=True):
            wide, outside = one.result()
            pairs = zip(np.nanmedian(wide, axis=0), outside.sum(axis=0), strict=True)
            text = "".join(f"{width:16.2f}{count:9d}" for width, count in pairs)
            print(f"{kind.name:20}{text}", flush=True)
