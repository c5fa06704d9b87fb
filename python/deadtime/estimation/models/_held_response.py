"""Response of an integrator with lag to held commands, at any time, with its derivatives.

A command u_k that holds from t_k to t_{k+1} goes into gain/(s (lag s + 1)). For a gain of one,

    v' = (u - v)/lag,  F' = v,  F(t) = I(t) - lag v(t),  I = the integral of u,

(v = u without a lag), from rest before the first command. Both are exact: between commands I is a
line and v - u_k decays as e^(-(t - t_k)/lag). dF/dt = v, and with p = dv/dlag, whose own
recursion is the derivative of that of v, dF/dlag = -v - lag p.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["HeldResponse", "Response"]

Array = NDArray[np.float64]

#: Largest relative range of the time between commands that counts as rounding of even times.
EVEN = 1e-11


class Response(NamedTuple):
    """F, dF/dt and dF/dlag at some times."""

    value: Array
    rate: Array
    by_lag: Array


class HeldResponse:
    """The response of an integrator to one record of commands.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Time from which each command holds, s, increasing; the last one holds for ever.
    command : ndarray, shape (n,)
        The commands.
    """

    def __init__(self, time: Array, command: Array) -> None:
        self.time, self.command = time, command
        self._steps = np.diff(time)
        self._kept: tuple[float, Array, Array] | None = None
        self._is_even = bool(np.ptp(self._steps) <= EVEN * self._steps.mean())
        # Shorter lags have no effect and would overflow below.
        self._shortest = 1e-7 * float(self._steps.min(initial=np.inf))
        self._integral = np.concatenate([[0.0], np.cumsum(command[:-1] * self._steps)])

    def at(self, times: Array, lag: float = 0.0) -> Response:
        """F and its derivatives at `times` for a lag in s."""
        row = np.searchsorted(self.time, times, side="right") - 1
        before = row < 0
        row = np.maximum(row, 0)
        since = np.where(before, 0.0, times - self.time[row])
        command = np.where(before, 0.0, self.command[row])
        integral = self._integral[row] + command * since
        if lag <= self._shortest:
            # To first order a lag is a delay: dF/dlag = -v at no lag.
            return Response(integral - lag * command, command, -command)
        velocity, by_lag = self._velocities(lag)
        decay = np.exp(-since / lag)
        gap = np.where(before, 0.0, velocity[row] - command)
        v = command + gap * decay
        p = np.where(before, 0.0, by_lag[row]) * decay + gap * decay * since / lag**2
        return Response(integral - lag * v, v, -v - lag * p)

    def _velocities(self, lag: float) -> tuple[Array, Array]:
        """The velocity v and dv/dlag at the start of each command; kept for the last lag."""
        if self._kept is None or self._kept[0] != lag:
            decays, rates = np.exp(-self._steps / lag), self._steps / lag**2
            recursion = _even if self._is_even else _uneven
            self._kept = (lag, *recursion(self.command, decays, rates))
        return self._kept[1], self._kept[2]


def _even(command: Array, decays: Array, rates: Array) -> tuple[Array, Array]:
    """The recursion of v and dv/dlag for evenly spaced commands, as two filters."""
    from scipy.signal import lfilter

    d = float(decays[0])
    v = lfilter([0.0, 1.0 - d], [1.0, -d], command)
    p = lfilter([0.0, d * float(rates[0])], [1.0, -d], v - command)
    return np.asarray(v), np.asarray(p)


def _uneven(command: Array, decays: Array, rates: Array) -> tuple[Array, Array]:
    """The recursion of v and dv/dlag, step by step."""
    v, p = np.zeros_like(command), np.zeros_like(command)
    now, slope = 0.0, 0.0
    for k, (u, decay, rate) in enumerate(
        zip(command[:-1].tolist(), decays.tolist(), rates.tolist(), strict=True), 1
    ):
        slope = decay * (slope + (now - u) * rate)
        now = u + (now - u) * decay
        v[k], p[k] = now, slope
    return v, p
