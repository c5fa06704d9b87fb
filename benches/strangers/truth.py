"""The range in which an answer is right, and the errors of a fit that knows the plant.

The range spans the linear plant without its fault and the best linear plants for the responses to
four other commands, without noise, where the fault is part of what a loop feels. It also spans the
gains and delays that the record went through. Where the acceleration is limited, the best linear
plants belong to it in every row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from strangers.faults import Fault, nothing
from strangers.least_squares import data_of, fitted, standard_errors
from strangers.linear import Array
from strangers.plants import Runs
from strangers.simulate import Logs, logged

#: Other commands that the best linear plants are for.
OTHERS = 4

#: Of which there is a truth.
QUANTITIES = ("gain", "delay", "largest gain")

#: Half width of an interval of 95 % over the standard error.
HALF_WIDTH = 1.96


@dataclass(frozen=True)
class Truth:
    """Crossover of the true plants, shape (runs,); the others (runs, 3), one for each quantity.

    `half_width` is that of a fit of the right plant to the run without its fault, relative.
    """

    omega: Array
    low: Array
    high: Array
    half_width: Array


def truth_of(runs: Runs, logs: Logs, fault: Fault | None, sizes: Array) -> Truth:
    """The truth of runs that were logged with a fault of these sizes."""
    kind, omega = runs.kind, runs.linear.crossover()
    true = runs.linear.felt(omega)
    found = [true]
    limited = bool(np.isfinite(runs.linear.acceleration).any())
    if limited or (fault is not None and fault.in_loop):
        found += [best(runs, fault, sizes, omega, time) for time in range(1, OTHERS + 1)]
    if fault is not None and fault.name == "delay change":
        late = replace(runs.linear, delay=runs.linear.delay * (1.0 + sizes))
        found.append(late.felt(omega))
    factors = np.log(np.maximum(logs.gains, 1e-3))
    found += [true + factor[:, None] * np.array([1.0, 0.0, -1.0]) for factor in factors.T]
    ends = [np.nanmin(found, axis=0), np.nanmax(found, axis=0)]
    low, high = (_in_units(end) for end in ends)
    clean = logged(runs)
    data = data_of(kind, runs.dt, clean.command, clean.output)
    errors = HALF_WIDTH * standard_errors(runs.linear, data, runs.deviation, omega)
    errors[:, 1] /= true[:, 1]
    return Truth(omega, low, high, errors)


def best(runs: Runs, fault: Fault | None, sizes: Array, omega: Array, time: int) -> Array:
    """What a loop feels of the best linear plants for other commands; logarithms of gains."""
    others = runs.commanded_again(time)
    chain = nothing(others) if fault is None else fault.chain(others, sizes, time)
    logs = logged(others, chain)
    data = data_of(runs.kind, runs.dt, logs.command, logs.output)
    return fitted(runs.linear.without_limit, data).felt(omega)


def _in_units(felt: Array) -> Array:
    """Gains in place of their logarithms."""
    return np.stack([np.exp(felt[:, 0]), felt[:, 1], np.exp(felt[:, 2])], axis=1)
