"""Fit of a function of time by piecewise Legendre series, with an error of the size of rounding.

The function is first sampled evenly, at distances of at most a given gap, and every piece has to
reproduce the samples within it: events longer than the gap are found, shorter ones may be missed. A
piece uses the Gauss nodes of its interval and two points close to its ends. If the last
coefficients are not below rounding, or the series does not reproduce all known values, the interval
is halved; all intervals of a round are evaluated in one call. An interval that has become too short
to be halved contains a jump, which is located by bisection, or a kink, which is refused.

Rounding affects the values, and the time, which changes a value by eps |t| |u'|.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from deadtime._base.arrays import Array, Mask
from deadtime.systems._native import legendre_tables

Sampler = Callable[[Array], Array]

#: Shortest event of a callable that the even samples do not miss, as a fraction of the span: a
#: smaller one finds more events and calls the function more often.
RESOLUTION = 1e-3

# The values at these nodes times this matrix are the coefficients.
_TABLES = legendre_tables()
_NODES, _TRANSFORM = _TABLES.nodes, _TABLES.transform
_TERMS = len(_NODES)

_EPS = float(np.finfo(float).eps)

# A series is accurate to rounding if its last two coefficients are below this fraction of the
# largest value: with a smaller one rounding errors would halve intervals for ever, a larger one
# gives less accurate series.
_ENDED = 16.0 * _EPS

# Relative error of the time that the values of a callable may have, since its own operations round.
_UNITS = 8.0 * _EPS

# Upper limit on the effect of that error on the values, as a fraction of their variation on a
# piece: a piece with a larger effect is so short that it cannot be distinguished from a jump.
_BLURRED = 1e-3

# Tolerance for the difference of a series from samples, relative to that for its last coefficients.
_OFF = 30.0

# Distance from the ends of a piece to the points close to them, relative to the time.
_INSET = 4.0 * _EPS

# Shortest interval that is halved, as a fraction of the span: a shorter one contains a break.
_SHORTEST = 1e-9

# Upper limits on the number of intervals of one function, of breaks found in it and of its even
# samples (they bound memory and time).
_MOST = 20_000
_MOST_BREAKS = 1_000
_MOST_SAMPLES = 1_000_000


class Pieces(NamedTuple):
    """Coefficient k of component i in piece j at ``series[j, i, k]``; pieces after a break."""

    edges: Array
    series: Array
    breaks: list[int]


class _Known(NamedTuple):
    """Even samples, the largest modulus of each component, and the shortest interval to halve."""

    times: Array
    values: Array
    scale: Array
    shortest: float


def pieces(
    name: str, sample: Sampler, span: tuple[float, float], breaks: Iterable[float], gap: float
) -> Pieces:
    """Fit what `sample` gives, shape (width, m) at m times, over `span` between its breaks."""
    low, high = span
    corners = [low, *sorted({float(b) for b in breaks if low < b < high}), high]
    if (high - low) / gap > _MOST_SAMPLES:
        raise ValueError(
            f"max_step={gap:g}: that is more than {_MOST_SAMPLES} samples of {name} from "
            f"{low:g} to {high:g} s; give a larger one, and name what is shorter in "
            f"{_option(name)}"
        )
    known = _known(sample, corners, gap)
    found, rough = _divided(name, sample, corners, known)
    if len(rough):
        corners = sorted({*corners, *_jumps(name, sample, rough, known)})
        found, rough = _divided(name, sample, corners, known)
        if len(rough):
            raise ValueError(_not_smooth(name, float(rough[0, 1])))
    starts = [int(place) for place in np.searchsorted(found[0], corners[1:-1])]
    return Pieces(found[0], found[1], starts)


def _option(name: str) -> str:
    return f"{name.split()[0]}_breaks"


def _not_smooth(name: str, time: float) -> str:
    return (
        f"{name} is not smooth at t = {time:.10g} s: name the time in {_option(name)}, or give "
        "samples"
    )


def _known(sample: Sampler, corners: list[float], gap: float) -> _Known:
    """Sample at the middles of equal parts no longer than `gap`, never at a break."""
    middles = []
    for left, right in pairwise(corners):
        parts = max(1, int(np.ceil((right - left) / gap)))
        middles.append(left + (right - left) * (np.arange(parts) + 0.5) / parts)
    times = np.concatenate(middles)
    values = sample(times)
    low, high = corners[0], corners[-1]
    shortest = max(_SHORTEST * (high - low), 16.0 * _EPS * max(abs(low), abs(high)))
    return _Known(times, values, np.abs(values).max(axis=1), shortest)


def _divided(
    name: str, sample: Sampler, corners: list[float], known: _Known
) -> tuple[tuple[Array, Array], Array]:
    """Edges and series of the pieces, and intervals, shape (m, 2), that no series can fit."""
    waiting = np.array(list(pairwise(corners)))
    scale = known.scale
    done: list[Array] = []
    series: list[Array] = []
    rough: list[Array] = []
    count = 0
    while len(waiting):
        a, b = waiting.T
        values, ends = _values(sample, a, b)
        scale = np.maximum(scale, np.abs(values).max(axis=(0, 2)))
        found = values @ _TRANSFORM
        allowed = np.maximum(_ENDED * scale, _blur(values, a, b))
        good = (np.abs(found[:, :, -2:]).max(axis=2) <= allowed).all(axis=1)
        good &= _reproduces(found, waiting, allowed, ends, known)
        done.append(waiting[good])
        series.append(found[good])
        count += int(good.sum())
        is_short = ~good & (b - a <= known.shortest)
        rough.append(waiting[is_short])
        waiting = waiting[~good & ~is_short]
        if count + 2 * len(waiting) > _MOST:
            raise ValueError(
                f"{name} needs more than {_MOST} polynomial pieces, first near t = "
                f"{waiting[0, 0]:.10g} s: it is too rough or too fast for one run of "
                f"{corners[-1] - corners[0]:g} s; shorten the run, or give samples"
            )
        middle = waiting.mean(axis=1)
        halves = (np.stack([waiting[:, 0], middle], 1), np.stack([middle, waiting[:, 1]], 1))
        waiting = np.concatenate(halves)
    spans = np.concatenate(done)
    order = np.argsort(spans[:, 0])
    edges = np.append(spans[order, 0], corners[-1])
    return (edges, np.concatenate(series)[order]), np.concatenate(rough)


def _values(sample: Sampler, a: Array, b: Array) -> tuple[Array, tuple[Array, Array]]:
    """Values at the nodes, shape (m, width, node); points close to the ends and values there."""
    half, middle = 0.5 * (b - a), 0.5 * (a + b)
    inset = np.minimum(_INSET * np.maximum(np.abs(a), np.abs(b)), 0.25 * (b - a))
    inset = np.maximum(inset, _EPS * (b - a))
    near = np.stack([a + inset, b - inset], 1)
    nodes = 0.5 * (np.outer(a, 1.0 - _NODES) + np.outer(b, 1.0 + _NODES))
    times = np.concatenate([nodes, near], axis=1)
    values = sample(times.ravel()).reshape(-1, *times.shape).transpose(1, 0, 2)
    places = (near - middle[:, None]) / half[:, None]
    return np.ascontiguousarray(values[:, :, :-2]), (places, values[:, :, -2:])


def _blur(values: Array, a: Array, b: Array) -> Array:
    """Effect of rounding of the time on the values of each piece."""
    gaps = 0.5 * np.outer(b - a, np.diff(_NODES))
    rates = (np.abs(np.diff(values, axis=2)) / gaps[:, None, :]).max(axis=2)
    times = np.maximum(np.abs(a), np.abs(b))[:, None]
    return np.asarray(np.minimum(_UNITS * times * rates, _BLURRED * np.ptp(values, axis=2)))


def _reproduces(
    series: Array,
    spans: Array,
    allowed: Array,
    ends: tuple[Array, Array],
    known: _Known,
) -> Mask:
    """Whether each series reproduces the known values: those close to the ends and the samples."""
    places, values = ends
    table = legendre.legvander(places, _TERMS - 1)
    off = np.abs(np.einsum("mek,mwk->mwe", table, series) - values).max(axis=2)
    good: Mask = (off <= _OFF * allowed).all(axis=1)
    order = np.argsort(spans[:, 0])
    owner = order[np.searchsorted(spans[order, 0], known.times, side="right") - 1]
    left, right = spans[owner].T
    inside = (known.times > left) & (known.times < right)
    owner, left, right = owner[inside], left[inside], right[inside]
    times, values = known.times[inside], known.values[:, inside]
    table = legendre.legvander(((times - left) - (right - times)) / (right - left), _TERMS - 1)
    off = np.abs(np.einsum("sk,swk->sw", table, series[owner]) - values.T)
    good[owner[(off > _OFF * allowed[owner]).any(axis=1)]] = False
    return good


def _jumps(name: str, sample: Sampler, rough: Array, known: _Known) -> Array:
    """First times after the jumps in these intervals; a kink is refused."""
    if len(rough) > _MOST_BREAKS:
        raise ValueError(_not_smooth(name, float(rough[0, 1])))
    low, high = rough[:, 0].copy(), rough[:, 1].copy()
    before, after = sample(low), sample(high)
    middle = 0.5 * (low + high)
    while ((low < middle) & (middle < high)).any():
        value = sample(middle)
        left = np.abs(value - before).sum(axis=0) <= np.abs(value - after).sum(axis=0)
        low, high = np.where(left, middle, low), np.where(left, high, middle)
        middle = 0.5 * (low + high)
    height = np.abs(sample(high) - sample(low))
    change = np.abs(after - before)
    is_jump = (height > _OFF * _ENDED * known.scale[:, None]) & (height > 0.5 * change)
    kinks = np.flatnonzero(~is_jump.any(axis=0))
    if len(kinks):
        raise ValueError(_not_smooth(name, float(rough[kinks[0], 1])))
    return high
