"""Masked cross-correlation of a setpoint and a response, with leave-one-out over blocks.

On a regular grid finer than the rows, only pairs of times that lie in one segment count (Padfield
2012, masked normalised cross-correlation): for each lag l

    r(l) = (Sxy - Sx Sy/n) / sqrt((Sxx - Sx^2/n) (Syy - Sy^2/n)),

each sum over the n pairs x(t - l), y(t) that exist. The sums of blocks of the response add up, so
that r without a block costs nothing; the scatter of the peak over these is that of the jackknife
(Efron and Tibshirani 1993, chapter 11).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime.logs._series import Series

#: Points of the grid for each row of the faster series, and its least step, s: a parabola finds
#: the peak to a small part of that.
FINER, FINEST = 2.0, 5e-4

#: Blocks of a record for the jackknife: more are less independent, fewer have longer tails.
BLOCKS = 12

#: Shortest block, in longest lags; fewest blocks whose scatter is asked.
BLOCK, FEWEST = 2.0, 4

#: Least lag that is tried, as a share of the longest: a response before its setpoint is a fault of
#: the stamps, which is to be seen.
AHEAD = 0.25


class Piece(NamedTuple):
    """One segment on the grid: setpoint and response, each less its mean, and the first time."""

    start: float
    asked: Array
    response: Array


class Grid(NamedTuple):
    """All segments on a regular grid; `step` in s."""

    step: float
    pieces: list[Piece]

    @property
    def length(self) -> float:
        """Length of all segments, s."""
        return self.step * sum(piece.asked.size for piece in self.pieces)


class Correlation(NamedTuple):
    """The correlation by lag, shape (n,) each, and without each block, shape (blocks, n)."""

    lags: Array
    coefficient: Array
    without: Array


def grid_of(
    setpoint: Series, response: Series, segments: Sequence[tuple[float, float]], held: bool
) -> Grid:
    """Both signals over the segments; the setpoint holds from row to row or is straight."""
    step = max(min(setpoint.period, response.period) / FINER, FINEST)
    pieces = []
    for low, high in segments:
        time = np.arange(low, high, step)
        asked = value_at(setpoint, time, held)
        measured = value_at(response, time, False)
        if time.size > 1 and np.isfinite(asked).all() and np.isfinite(measured).all():
            pieces.append(Piece(low, asked, measured))
    if not pieces:
        return Grid(step, [])
    means = [float(np.mean(np.concatenate([piece[k] for piece in pieces]))) for k in (1, 2)]
    return Grid(step, [Piece(p.start, p.asked - means[0], p.response - means[1]) for p in pieces])


def value_at(series: Series, time: Array, held: bool) -> Array:
    """A series at other times: its last value, or straight lines between its rows."""
    known = np.isfinite(series.values)
    at, values = series.time[known], series.values[known]
    if at.size == 0:
        return np.full(time.shape, np.nan)
    if held:
        rows = np.searchsorted(at, time, side="right") - 1
        return np.asarray(values[np.maximum(rows, 0)])
    return np.asarray(np.interp(time, at, values))


def correlation_of(grid: Grid, longest: float) -> Correlation:
    """The correlation at lags from a quarter of `longest`, s, ahead to `longest`."""
    first, last = (round(end / grid.step) for end in (-AHEAD * longest, longest))
    lags = np.arange(first, last + 1)
    times = np.asarray(lags * grid.step, dtype=float)
    length = max(grid.length / BLOCKS, BLOCK * longest)
    blocks = []
    for piece in grid.pieces:
        count = max(1, round(piece.asked.size * grid.step / length))
        edges = np.linspace(0, piece.asked.size, count + 1).astype(int)
        blocks += [_sums(piece, lags, a, b) for a, b in pairwise(edges.tolist())]
    if not blocks:
        return Correlation(times, np.full(lags.size, np.nan), np.empty((0, lags.size)))
    sums = np.stack(blocks)
    whole = sums.sum(axis=0)
    without = _coefficient(whole - sums) if len(blocks) > 1 else np.empty((0, lags.size))
    return Correlation(times, _coefficient(whole), without)


def correlated(values: Array, pattern: Array) -> Array:
    """Sums of pattern(k) values(k + lag), by lag from zero to where the pattern ends both.

    Over the last axis, by FFT. `scipy.signal` has it, and takes half a second to load.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(values.shape[-1], real=True)
    found = irfft(rfft(values, size) * np.conj(rfft(pattern, size)), size)
    return np.asarray(found[..., : values.shape[-1] - pattern.shape[-1] + 1])


def _sums(piece: Piece, lags: NDArray[np.int64], start: int, stop: int) -> Array:
    """n, Sx, Sxx, Sy, Syy and Sxy for the response in one block, shape (6, lags)."""
    first, last = start - int(lags[-1]), stop - int(lags[0])
    ends = max(0, -first), max(0, last - piece.asked.size)
    inside = piece.asked[max(0, first) : last]
    asked = np.pad(inside, ends)
    known = np.pad(np.ones(inside.size), ends)
    output = piece.response[start:stop]
    ones = np.ones_like(output)
    values = np.stack([known, asked, asked**2, known, known, asked])
    return correlated(values, np.stack([ones, ones, ones, output, output**2, output]))[:, ::-1]


def _coefficient(sums: Array) -> Array:
    """Padfield's coefficient from sums of shape (..., 6, lags); NaN where nothing moves."""
    n, x, xx, y, yy, xy = np.moveaxis(sums, -2, 0)
    n = np.where(n > 0.5, n, np.nan)
    power = (xx - x**2 / n) * (yy - y**2 / n)
    least = 1e-9 * np.abs(xx * yy)
    return np.asarray((xy - x * y / n) / np.sqrt(np.where(power > least, power, np.nan)))


def peak_of(lags: Array, coefficient: Array) -> tuple[float, float]:
    """Lag and height of the largest value, by a parabola; NaN where it is at an end."""
    if not np.isfinite(coefficient).any():
        return np.nan, np.nan
    k = int(np.nanargmax(coefficient))
    if k in (0, coefficient.size - 1) or not np.isfinite(coefficient[k - 1 : k + 2]).all():
        return np.nan, float(coefficient[k])
    before, at, after = coefficient[k - 1 : k + 2].tolist()
    bend = before - 2.0 * at + after
    share = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    height = at - 0.25 * (before - after) * share
    return float(lags[k] + share * (lags[1] - lags[0])), float(height)


def independent_rows(grid: Grid, longest: float) -> float:
    """How many independent pairs a record is equal to, by Bartlett's formula."""
    total, power = 0.0, [0.0, 0.0]
    shared = np.zeros(1)
    for piece in grid.pieces:
        reach = min(round(longest / grid.step), piece.asked.size - 1)
        parts = [_autocovariance(values, reach) for values in (piece.asked, piece.response)]
        both = parts[0] * parts[1] / piece.asked.size
        shared = np.pad(shared, (0, max(0, both.size - shared.size)))
        shared[: both.size] += both
        power = [old + float(part[0]) for old, part in zip(power, parts, strict=True)]
        total += piece.asked.size
    if not (power[0] > 0.0 and power[1] > 0.0):
        return 0.0
    ratio = shared * total / (power[0] * power[1])
    return float(total / max(1.0, ratio[0] + 2.0 * float(np.sum(ratio[1:]))))


def _autocovariance(values: Array, reach: int) -> Array:
    return correlated(np.pad(values, (0, reach)), values)
