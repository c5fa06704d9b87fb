"""Inputs of a run besides a held reference: loads, disturbances of the output, noise, functions.

Each is piecewise a polynomial. The stepper carries it as states that jump where the pieces join, so
that the response stays exact to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.validation import increasing, non_negative, real_array
from deadtime.loops._native import on_samples
from deadtime.loops._specification import LoopSpecification

#: Degree of the pieces of a function: a higher one needs fewer pieces and more states.
_DEGREE = 7

#: Largest error of a piece relative to the largest value: rounding of the function must pass.
_ERROR = 1e-12

#: Even pieces of a function before it is fitted: more find shorter events and call it more often.
_PIECES = 64

#: Halvings of a piece after which a jump is taken to lie in it: more locate it better.
_HALVINGS = 36

#: Relative errors of the time that a function is allowed: products and sums of it are rounded.
_TIME_ROUNDING = 8.0 * float(np.finfo(float).eps)

#: Most pieces of a function: each of them comes back after every delay.
_MOST_PIECES = 50_000

#: Places within a piece, from -1 to 1, at which its fit is compared with the function.
_PROBES = np.cos(np.linspace(0.03, np.pi - 0.04, 11))


@runtime_checkable
class SampledNoise(Protocol):
    """What draws noise at given times."""

    def sample(self, time: Array, seed: Any) -> Array:
        """Noise at the times (s), shape (n,); the same for the same seed."""


#: A number: from the start on. An array: values that hold from the output times on. A pair: times
#: and the values that hold from them on. A function of the time in s.
Input: TypeAlias = ArrayLike | tuple[ArrayLike, ArrayLike] | Callable[[Any], Any]


class Kicks(NamedTuple):
    """Jumps of states that are inputs, as the stepper takes them."""

    times: Array
    inputs: list[int]
    values: Array


class Driven(NamedTuple):
    """Inputs of a run: names and degrees, and the jumps of their states."""

    names: list[tuple[str, int]]
    kicks: Kicks

    @property
    def states(self) -> int:
        """How many states they are."""
        return sum(degree + 1 for _, degree in self.names)


class _Pieces(NamedTuple):
    """Starts of pieces in s, increasing, and value and derivatives there, one row a piece."""

    starts: Array
    derivatives: Array


def driven(
    loop: LoopSpecification,
    times: Array,
    phase: float,
    inputs: dict[str, Any],
    seed: int | np.random.SeedSequence,
) -> Driven:
    """The inputs that are not None, of a run at these times."""
    names: list[tuple[str, int]] = []
    when: list[Array] = [np.empty(0)]
    values: list[Array] = [np.empty(0)]
    which = [np.empty(0, dtype=np.intp)]
    first = 0
    for name, given in inputs.items():
        if given is None:
            continue
        pieces = _pieces_of(loop, name, given, times, phase, seed)
        late = name in ("load", "output")
        since = pieces.starts - times[0] + (loop.output_lead if late else 0.0)
        if loop.sample_time is not None:
            since = on_samples(since, float(times[0]), loop.sample_time, phase)
        size = pieces.derivatives.shape[1]
        names.append((name, size - 1))
        # What does not change makes no break.
        before = np.vstack([np.zeros(size), pieces.derivatives[:-1]])
        moved = (pieces.derivatives != before) | (size > 1)
        when.append(np.maximum(np.repeat(since, size), 0.0)[moved.ravel()])
        which.append(np.tile(np.arange(first, first + size), since.size)[moved.ravel()])
        values.append(pieces.derivatives[moved])
        first += size
    moments = np.concatenate(when)
    order = np.argsort(moments, kind="stable")
    states = np.concatenate(which)[order].tolist()
    return Driven(names, Kicks(moments[order], states, np.concatenate(values)[order]))


def held_input(
    loop: LoopSpecification, name: str, given: Any, times: Array, seed: Any
) -> tuple[Array, Array]:
    """An input that is no function as times and the values that hold from them on."""
    pieces = _pieces_of(loop, name, given, times, 0.0, seed)
    return pieces.starts, pieces.derivatives[:, 0]


def _pieces_of(
    loop: LoopSpecification, name: str, given: Any, times: Array, phase: float, seed: Any
) -> _Pieces:
    drawn = _noise(loop, times, phase, given, seed) if name == "noise" else None
    return drawn or _pieces(_TITLES[name], given, times)


def at_samples(
    loop: LoopSpecification, function: Callable[[Any], Any], times: Array, phase: float
) -> tuple[Array, Array]:
    """Times of the samples of a run, and a function there."""
    when = _samples(loop.sample_time or 1.0, times, phase)
    return when, real_array("the value of reference", function(when))


def _samples(sample_time: float, times: Array, phase: float) -> Array:
    count = math.floor((times[-1] - times[0] - phase) / sample_time) + 1
    return np.asarray(times[0] + phase + sample_time * np.arange(max(count, 1)))


#: What the inputs are called in arguments.
_TITLES = {
    "reference": "reference",
    "load": "load",
    "output": "output_disturbance",
    "noise": "noise",
}


def _pieces(name: str, given: Any, times: Array) -> _Pieces:
    if callable(given):
        return _fitted(name, given, times)
    if isinstance(given, tuple):
        if len(given) != 2:
            raise ValueError(
                f"{name} is a tuple of {len(given)} entries: give a pair of two arrays, times "
                "and values"
            )
        starts = increasing(f"the times of {name}", given[0])
        values = real_array(name, given[1])
    else:
        values = real_array(name, given)
        starts = times[:1] if values.ndim == 0 else times
    values = values.reshape(1) if values.ndim == 0 else values
    if values.shape != starts.shape or values.size == 0:
        raise ValueError(
            f"{name} has shape {values.shape}, and its times have shape {starts.shape}: give a "
            "number, one value for each entry of time, a pair (times, values), or a function "
            "of time"
        )
    if not np.isfinite(values).all():
        raise ValueError(f"{name} contains {values[~np.isfinite(values)][0]}: give finite numbers")
    # Before the start of the run only the last value matters.
    past = int(np.searchsorted(starts, times[0], side="right"))
    if past > 1:
        starts, values = starts[past - 1 :], values[past - 1 :]
    return _Pieces(np.maximum(starts, times[0]), values[:, None])


def _noise(
    loop: LoopSpecification,
    times: Array,
    phase: float,
    given: Any,
    seed: int | np.random.SeedSequence,
) -> _Pieces | None:
    """Noise that is drawn: at the samples of the loop, or at the output times."""
    is_model = isinstance(given, SampledNoise)
    if not is_model and (callable(given) or isinstance(given, tuple) or np.ndim(given) != 0):
        return None
    when = times if loop.sample_time is None else _samples(loop.sample_time, times, phase)
    if is_model:
        drawn = real_array("noise", given.sample(when, seed))
    else:
        deviation = non_negative("noise", given)
        drawn = deviation * np.random.default_rng(seed).standard_normal(when.size)
    if drawn.shape != when.shape:
        raise ValueError(
            f"noise returned values of shape {drawn.shape} for {when.size} times: return one "
            "value for each time"
        )
    return _Pieces(when, drawn[:, None])


def _moved(derivatives: Array, length: float) -> Array:
    """Derivatives of a polynomial a time later."""
    size = derivatives.size
    terms = [length**power / math.factorial(power) for power in range(size)]
    return np.array([np.dot(derivatives[row:], terms[: size - row]) for row in range(size)])


def _fitted(name: str, function: Callable[[Any], Any], times: Array) -> _Pieces:
    """A function as polynomials, each as good as rounding but where it jumps.

    Each is compared with the function at the output times too: what these show is not missed.
    """
    span = (float(times[0]), float(times[-1]))

    def values(when: Array) -> Array:
        found = real_array(f"the value of {name}", function(when))
        found = np.broadcast_to(found, when.shape) if found.ndim == 0 else found
        if found.shape != when.shape or not np.isfinite(found).all():
            raise ValueError(
                f"{name} returned values of shape {found.shape} for {when.size} times, or "
                "values that are not finite: give a function that takes an array of times in s"
            )
        return found

    if span[1] <= span[0]:
        return _Pieces(np.array(span[:1]), values(np.array(span[:1]))[:, None])
    nodes = chebyshev.chebpts1(_DEGREE + 1)
    places = np.concatenate([nodes, _PROBES])
    to_series = np.linalg.inv(chebyshev.chebvander(nodes, _DEGREE))
    powers = np.arange(nodes.size, dtype=float)
    factorials = np.array([math.factorial(power) for power in range(nodes.size)])
    units = (chebyshev.cheb2poly(row) for row in np.eye(nodes.size))
    taylor = (np.pad(row, (0, nodes.size - row.size)) * factorials for row in units)
    to_taylor = np.array([_moved(row, -1.0) for row in taylor])
    at_probes = chebyshev.chebvander(_PROBES, _DEGREE)
    shown = values(times)
    edges = np.linspace(*span, _PIECES + 1)
    low, high = edges[:-1], edges[1:]
    shortest = (span[1] - span[0]) * 0.5**_HALVINGS
    size, count, starts, rows = 0.0, 0, [], []
    while low.size:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        found = values((middle[:, None] + half[:, None] * places).ravel()).reshape(low.size, -1)
        size = max(size, float(np.abs(found).max()))
        series = found[:, : nodes.size] @ to_series.T
        error = np.abs(series @ at_probes.T - found[:, nodes.size :]).max(axis=1)
        order = np.argsort(low)
        piece = order[np.searchsorted(low[order], times, side="right") - 1]
        within = (times > low[piece]) & (times < high[piece])
        piece = piece[within]
        there = chebyshev.chebvander((times[within] - middle[piece]) / half[piece], _DEGREE)
        deviation = np.abs((there * series[piece]).sum(axis=1) - shown[within])
        np.maximum.at(error, piece, deviation)
        # Rounding of the time moves a function as far as its slope says.
        slope = np.abs(series) @ powers**2 / half
        late = np.maximum(np.abs(low), np.abs(high))
        allowed = _ERROR * size + _TIME_ROUNDING * late * slope
        done = (error <= allowed) | (half < shortest)
        count += int(np.count_nonzero(done))
        if count + 2 * np.count_nonzero(~done) > _MOST_PIECES:
            raise ValueError(
                f"{name} changes too often: {_MOST_PIECES} pieces cannot follow it between its "
                "jumps. Give a shorter run, or a pair (times, values)"
            )
        lengths = half[done, None]
        # Where a jump lies within, what follows sets the value after it.
        smooth = np.where(lengths < shortest, powers == 0.0, 1.0)
        starts.append(low[done])
        rows.append(series[done] @ to_taylor * lengths**-powers * smooth)
        low, high, middle = low[~done], high[~done], middle[~done]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    every = np.concatenate(starts)
    order = np.argsort(every)
    return _Pieces(every[order], np.concatenate(rows)[order])
