"""Functions of time for the native part: piecewise Legendre series.

Constants, held samples and linear interpolation of samples are exact; a callable is fitted with an
error of the size of rounding. Times are counted from the start of the run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.validation import real_array
from deadtime.systems._native import Signal, fitted_series

#: Shortest event of a callable that its even samples do not miss, as a fraction of the span: a
#: smaller one finds more events and calls the function more often.
RESOLUTION = 1e-3

_FOREVER = float("inf")


class Fitted(NamedTuple):
    """A fitted callable: coefficient k of component i in piece j at ``series[j, i, k]``."""

    edges: Array
    series: Array
    breaks: list[int]

    def derivative(self) -> Fitted:
        """Series of the derivative."""
        slopes = np.zeros_like(self.series)
        slopes[:, :, :-1] = legendre.legder(self.series, axis=2)
        slopes *= (2.0 / np.diff(self.edges))[:, None, None]
        return self._replace(series=slopes)

    def signal(self) -> Signal:
        """Give the native form, defined only within the pieces."""
        return Signal(self.edges, np.ascontiguousarray(self.series), self.breaks)

    def input_signal(self, before: Array) -> Signal:
        """Give the native form, constant at `before` before the pieces and constant after them."""
        edges = np.concatenate([[-_FOREVER], self.edges, [_FOREVER]])
        outer = np.zeros((2, *self.series.shape[1:]))
        outer[0, :, 0] = before
        outer[1, :, 0] = self.series[-1].sum(axis=1)
        series = np.concatenate([outer[:1], self.series, outer[1:]])
        return Signal(edges, series, [1, *(place + 1 for place in self.breaks)])


def constant(values: Array) -> Signal:
    """Give the signal with constant `values`, shape (p,)."""
    return Signal(np.array([-_FOREVER, _FOREVER]), values.reshape(1, -1, 1), [])


def step(before: Array, after: Array) -> Signal:
    """Give a step at the start from `before` to `after`, both of shape (p,)."""
    series = np.stack([before, after])[:, :, None]
    return Signal(np.array([-_FOREVER, 0.0, _FOREVER]), series, [1])


def held(times: Array, values: Array, before: Array) -> Signal:
    """Give a signal that holds each of `values`, shape (p, m), from its time on."""
    edges = np.concatenate([[-_FOREVER], times, [_FOREVER]])
    series = np.concatenate([before[:, None], values], axis=1).T[:, :, None]
    changed = np.any(series[1:] != series[:-1], axis=(1, 2))
    changed[0] = True
    keep = np.flatnonzero(np.append(True, changed))
    return Signal(
        np.append(edges[keep], _FOREVER),
        np.ascontiguousarray(series[keep]),
        list(range(1, len(keep))),
    )


def lines(times: Array, values: Array, before: Array) -> Signal:
    """Interpolate values, shape (p, m), at `times` linearly; the last one is held."""
    edges = np.concatenate([[-_FOREVER], times, [_FOREVER]])
    series = np.zeros((len(times) + 1, len(values), 2))
    series[0, :, 0] = before
    series[1:-1, :, 0] = (0.5 * (values[:, :-1] + values[:, 1:])).T
    series[1:-1, :, 1] = (0.5 * (values[:, 1:] - values[:, :-1])).T
    series[-1, :, 0] = values[:, -1]
    return Signal(edges, series, list(range(1, len(times) + 1)))


def sampled(
    name: str, function: Callable[..., ArrayLike], times: Array, width: int, vectorized: bool
) -> Array:
    """Evaluate a callable at `times` and check the values, shape (width, m)."""
    found: Any = function(times) if vectorized else [function(float(t)) for t in times]
    values = real_array(f"the value of {name}", found)
    if not vectorized:
        values = values.reshape(len(times), -1).T if values.ndim > 1 else values[None, :]
    elif values.ndim == 1:
        values = values[None, :]
    if values.shape != (width, len(times)):
        expected = f"({width}, {len(times)})" if vectorized else f"({width},) at each time"
        shape = values.shape if vectorized else values.shape[:1]
        raise ValueError(
            f"{name} returned an array of shape {shape}: return an array of shape {expected}"
        )
    is_finite = np.isfinite(values).all(axis=0)
    if not is_finite.all():
        at = int(np.argmin(is_finite))
        raise ValueError(
            f"{name} at t = {times[at]} s is {values[:, at][~np.isfinite(values[:, at])][0]}: give "
            "finite values"
        )
    return values


def fitted(
    name: str,
    function: Callable[..., ArrayLike],
    span: tuple[float, float],
    breaks: Iterable[float],
    width: int,
    *,
    start: float,
    vectorized: bool,
    max_step: float | None,
) -> Fitted:
    """Fit a callable over `span` between its breaks, with times counted from `start`."""

    def sample(times: Array) -> Array:
        return sampled(name, function, times, width, vectorized)

    gap = RESOLUTION * (span[1] - span[0]) if max_step is None else max_step
    found = fitted_series(
        name, sample, span=span, breaks=[float(b) for b in breaks], gap=gap, width=width
    )
    return Fitted(found.edges - start, found.series, found.breaks)
