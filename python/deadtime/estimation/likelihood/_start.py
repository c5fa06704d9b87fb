"""Least squares, from which the search of the noise starts, and the part of long recordings for it.

Least squares is the likelihood without air and coloured noise. Its cost has several local minima
over the delay, so a grid over delay and lag comes first, for each recording alone.

A search takes a few thousand evaluations, each linear in the rows. In a recording of more than
`PART` rows it is made on as many of them in which the command changes most; the maximum on all rows
is near, and takes some tens of evaluations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import PlantNumbers, RowNoise
from deadtime.estimation.likelihood._rows import FlightRows, is_outlier
from deadtime.estimation.likelihood._search import (
    LONGEST,
    ROUGH,
    NoiseFit,
    PlantModel,
    grid_lags,
    grid_minima,
    on_parts_of_rows,
    with_noise,
)

#: Most rows of a search.
PART = 5000

#: Accuracy of −2 ln L of the maximum on all rows.
CLOSE = 5e-3

#: Parts overlap so that each row is in so many of them.
OVERLAP = 4

#: Most points of the grid over the delay, and its step in rows: the cost has minima less than a row
#: apart, but not where a lag makes the response smooth.
MOST_POINTS, SHARP_STEP, SMOOTH_STEP = 600, 0.25, 1.0


def is_long(runs: Sequence[FlightRows]) -> bool:
    """Whether a search on all rows would take too long."""
    return any(rows.time.size > PART for rows in runs)


def excited_part(rows: FlightRows) -> FlightRows:
    """The rows of a search: all, or those in which the command changes most.

    They keep the commands of as long a time before them. What those before have left is a part of
    the offset.
    """
    count = rows.time.size
    if count <= PART:
        return rows
    changes = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(rows.command)))])
    firsts = np.arange(0, count - PART + 1, PART // OVERLAP)
    begin, end = rows.time[firsts], rows.time[firsts + PART - 1]
    ends = [np.searchsorted(rows.command_time, at, side="right") - 1 for at in (begin, end)]
    best = int(np.argmax(changes[ends[1]] - changes[np.maximum(ends[0], 0)]))
    first, start, stop = int(firsts[best]), float(begin[best]), float(end[best])
    kept = slice(first, first + PART)
    since = max(2.0 * start - stop, float(rows.command_time[0]))
    sent = slice(
        max(0, int(np.searchsorted(rows.command_time, since, side="right")) - 1),
        max(1, int(ends[1][best]) + 1),
    )
    return rows._replace(
        time=rows.time[kept],
        row_time=float(np.median(np.diff(rows.time[kept]))),
        output=rows.output[kept],
        used=rows.used[kept],
        speed=rows.speed[kept],
        command_time=rows.command_time[sent],
        command=rows.command[sent],
        unknown=tuple(one for one in rows.unknown if start < one[1] and one[0] < stop),
        uncertain=tuple(one for one in rows.uncertain if start < one[1] and one[0] < stop),
        offset=rows.offset or first > 0,
    )


def least_squares(
    model: PlantModel, runs: Sequence[FlightRows], delay: float, gain: float
) -> NoiseFit:
    """The fit under white noise alone; `delay` and `gain` where they are known."""
    zero = model.zero
    if zero == 0.0 and "zero" in model.names:
        # There its effect is that of a shorter delay: to first order, they cannot be told apart.
        zero = runs[0].row_time
    first = PlantNumbers(delay, model.lags, [RowNoise()], gain, zero)
    quiet = [RowNoise()] * len(runs)
    likelihood = model.likelihood(runs, False)
    found = []
    for rows in runs:
        alone = model.likelihood([rows], False)
        for point in _minima(model, rows, first):
            its_gain = alone.at(0, point).gain
            start = PlantNumbers(point.delay, point.lags, quiet, its_gain, point.zero)
            found.append(likelihood.fit(start, ROUGH))
    if not found:
        if {"delay", "zero"} <= set(model.names) and _tells_without_zero(model, runs[0], first):
            raise NotIdentifiableError(
                "delay and zero cannot be told apart: with a zero for every lag the output jumps "
                "with the command, and rows do not tell a later jump from a smaller one; leave one "
                "of them out of free=, or give the plant a further lag"
            )
        raise NotIdentifiableError(
            "the output does not depend on the command within the window: widen it, or check that "
            "the columns belong together"
        )
    best = min(found, key=lambda one: one.objective)
    return NoiseFit(model, tuple(runs), False, likelihood.fit(best))


def _tells_without_zero(model: PlantModel, rows: FlightRows, first: PlantNumbers) -> bool:
    """Whether a recording tells all numbers but the zero."""
    names = tuple(name for name in model.names if name != "zero")
    return bool(_minima(replace(model, names=names), rows, first))


def _minima(model: PlantModel, rows: FlightRows, first: PlantNumbers) -> list[PlantNumbers]:
    """The lowest local minima over the delay at each set of lags."""
    between = rows.row_time
    delays = [first.delay]
    if "delay" in model.names:
        longest = LONGEST * float(rows.time[-1] - rows.time[0])
        step = (SMOOTH_STEP if any(model.free_lags) else SHARP_STEP) * between
        count = int(min(MOST_POINTS, max(2.0, longest / step)))
        delays = on_parts_of_rows(np.linspace(0.0, longest, count + 1).tolist(), rows)
    likelihood = model.likelihood([rows], False)
    return [
        point
        for lags in grid_lags(model, between)
        for point in grid_minima(likelihood, delays, [lags], first.noise, first)
    ]


def on_all_rows(fit: NoiseFit, runs: Sequence[FlightRows]) -> NoiseFit:
    """The maximum on all rows of recordings, near the `fit` to parts of them, without outliers."""
    if any(noise.stamps for noise in fit.numbers.noise):
        quiet = with_noise(fit.numbers, [RowNoise()] * len(runs))
        white = replace(fit, runs=tuple(runs), numbers=quiet)
        runs = [
            rows._replace(speed=part.rate / part.gain)
            for rows, part in zip(runs, white.parts, strict=True)
        ]
    whole = replace(fit, runs=tuple(runs))
    kept = [
        rows._replace(used=rows.used & ~is_outlier(part.whitened, part.residuals, rows))
        for rows, part in zip(runs, whole.parts, strict=True)
    ]
    whole = replace(fit, runs=tuple(kept))
    return whole.moved(whole.likelihood.fit(fit.with_gain, CLOSE))
