"""Peers that simulate delay equations, each as its experts would drive it.

JiTCDDE: compiled C, steps made to end on breaking points through its inner stepper, since its own
`step_on_discontinuities` misses those after the first. scipy: `solve_ivp` restarted at every
multiple of the delay or at every sample, the past from its dense output. ddeint: as its page shows.
"""

from __future__ import annotations

import bisect
import contextlib
import shutil
import tempfile
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

try:
    import jitcdde
except ImportError:
    jitcdde = None
if shutil.which("cc") is None:  # what it compiles with
    jitcdde = None
try:
    from ddeint import ddeint
except ImportError:
    ddeint = None

Values = np.ndarray[Any, np.dtype[np.float64]]
#: Values (times, components) at given times.
Run = Callable[[Values], Values]
#: f(t, y, y(t - delay)).
Slope = Callable[[float, Values, Values], Values]


class Jitcdde:
    """One equation, compiled once; `run` gives its simulation at one tolerance."""

    def __init__(self, equations: list[Any], start: Values, delay: float) -> None:
        self.start, self.delay = start, delay
        self.dde = jitcdde.jitcdde(equations, max_delay=delay, verbose=False)
        # Its compilation reads the pyproject.toml of the folder it runs in.
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            self.dde.compile_C(verbose=False)

    def run(self, tolerance: float, breaks: int) -> Run:
        """With steps that end on the first `breaks` multiples of the delay."""

        def simulate(times: Values) -> Values:
            dde = self.dde
            dde.purge_past()
            dde.constant_past(self.start)
            dde.reset_integrator()
            dde.set_integration_parameters(
                atol=tolerance, rtol=tolerance, min_step=1e-14, first_step=1e-3 * self.delay
            )
            dde._initiate()
            dde.initial_discontinuities_handled = True
            found: list[Values] = []
            ends = [k * self.delay for k in range(1, breaks + 1)] + [float(times[-1])]
            for end in ends:
                while dde.t < end:
                    if not dde.try_single_step(min(dde.dt, end - dde.t)):
                        continue
                    dde.DDE.accept_step()
                    while len(found) < len(times) and times[len(found)] <= dde.t:
                        found.append(dde.DDE.get_recent_state(times[len(found)]))
                    dde.DDE.forget(self.delay)
            return np.array(found)

        return simulate


class _Past:
    """Dense outputs one after the other."""

    def __init__(self, start: Values) -> None:
        self.start = start
        self.starts: list[float] = []
        self.pieces: list[Callable[[float], Values]] = []

    def add(self, start: float, piece: Callable[[float], Values]) -> None:
        self.starts.append(start)
        self.pieces.append(piece)

    def __call__(self, t: float) -> Values:
        place = bisect.bisect_right(self.starts, t) - 1
        return self.start if place < 0 else self.pieces[place](t)


def scipy_steps(fun: Slope, start: Values, delay: float, tolerance: float) -> Run:
    """y' = fun(t, y, y(t - delay)) by the method of steps."""

    def simulate(times: Values) -> Values:
        past = _Past(start)
        y, at = start, 0.0
        while at < times[-1]:
            piece = solve_ivp(
                lambda t, y: fun(t, y, past(t - delay)),
                (at, at + delay),
                y,
                "DOP853",
                rtol=tolerance,
                atol=tolerance,
                dense_output=True,
            )
            past.add(at, piece.sol)
            y, at = piece.y[:, -1], at + delay
        return np.array([past(t) for t in times])

    return simulate


def scipy_samples(gain: float, delay: float, sample_time: float, limit: float) -> Run:
    """z' = u with u = sat(gain (1 - z(t_k - delay))) held from sample to sample."""

    def simulate(times: Values) -> Values:
        past = _Past(np.zeros(1))
        z = np.zeros(1)
        for k in range(int(np.ceil(times[-1] / sample_time)) + 1):
            at = k * sample_time
            u = np.clip(gain * (1.0 - past(at - delay)), -limit, limit)
            piece = solve_ivp(
                lambda t, y, u=u: u, (at, at + sample_time), z, rtol=1e-9, dense_output=True
            )
            past.add(at, piece.sol)
            z = piece.y[:, -1]
        return np.array([past(t) for t in times])

    return simulate


def by_ddeint(fun: Slope, start: Values, delay: float, points: int) -> Run:
    """y' = fun(t, y, y(t - delay)) between so many points."""

    # A vector of length one is refused, so one component is a number.
    one = len(start) == 1

    def slope(y: Callable[[float], Any], t: float) -> Any:
        if one:
            return float(fun(t, np.atleast_1d(y(t)), np.atleast_1d(y(t - delay)))[0])
        return fun(t, y(t), y(t - delay))

    def simulate(times: Values) -> Values:
        grid = np.linspace(0.0, times[-1], points)
        found = ddeint(slope, lambda t: float(start[0]) if one else start, grid)
        table = np.asarray(found).reshape(points, -1)
        return np.array([np.interp(times, grid, column) for column in table.T]).T

    return simulate
