"""The Cramér-Rao bound of the process that made a run, its parameters unknown.

The mean of the output depends on delay, gain and level, and on lag and trim where the process has
them. The Fisher information is J' V^-1 J: J holds the derivatives of the mean, given the commands
that were sent, and V is the covariance of everything else at the true parameters. The noise is in
the loop, but it acts there through the command, which is known, so it does not enter J (Ljung 1999,
section 7.4: the likelihood is that of prediction errors). The parameters of the noise are
orthogonal to those of the mean; that V of the air depends on the lag as well is left out.

A command in a row that was not logged is not known. The controller's law determines it from the
output and from the noise of that row, which is part of V: it is common to all rows that this
command moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import linalg
from scipy.special import ndtr

from reality.conditions import CORRELATED, LIMIT, Condition
from reality.generator import Array, Run, ramp

#: Step of the central differences, s or m or one.
STEP = 1e-6


def is_defined(condition: Condition, free: tuple[str, ...]) -> bool:
    """Whether the mean of the output given the log is known up to these parameters."""
    return not (
        condition.clock != 1.0
        or condition.nominal_stamps
        or condition.stamp_jitter
        or condition.commands_lost
        or condition.delay_wander
        or condition.delay_ramp
        or condition.second_lag
        or (condition.lag and "lag" not in free)
    )


def bounds(condition: Condition, run: Run, free: tuple[str, ...]) -> tuple[float, float]:
    """Least standard deviations of delay and of delay + lag, s; NaN where they have no meaning."""
    if not is_defined(condition, free):
        return math.nan, math.nan
    names = ["delay", "gain", "level", *["lag"] * condition.lag, *["trim"] * bool(condition.trim)]
    J, V = linearised(condition, run, names)
    cov = linalg.inv(J.T @ linalg.solve(V, J, assume_a="pos"))
    times = np.array([name in ("delay", "lag") for name in names], dtype=float)
    return math.sqrt(cov[0, 0]), math.sqrt(times @ cov @ times)


def linearised(condition: Condition, run: Run, names: list[str]) -> tuple[Array, Array]:
    """J, derivatives by these parameters, and V of the rows that are logged and no outliers.

    Unlogged rows have white noise only.
    """
    seen = run.logged & ~run.outlying
    varied = {name: np.eye(len(names))[i] for i, name in enumerate(names)}
    slopes = differences(run, varied, np.eye(int(np.sum(~run.logged))))[:, seen]
    J, B = slopes[: len(names)].T, slopes[len(names) :].T
    V = covariance(condition, run)[np.ix_(seen, seen)] + condition.white**2 * (B @ B.T)
    return J, V


def differences(run: Run, varied: dict[str, Array], noise: Array) -> Array:
    """Derivatives of the output by the varied parameters, then by the noise of unlogged rows."""
    count = len(varied)
    both = {name: np.concatenate([one, np.zeros(len(noise))]) for name, one in varied.items()}
    shifts = np.vstack([np.zeros((count, noise.shape[1])), noise])
    up, down = (
        outputs(run, {name: way * one for name, one in both.items()}, way * shifts)
        for way in (STEP, -STEP)
    )
    return (up - down) / (2.0 * STEP)


def outputs(run: Run, changed: dict[str, Array], noise: Array) -> Array:
    """Output for changed parameters, one variant a row of the result.

    Parameters
    ----------
    changed : dict of str to ndarray, shape (variants,)
        What is added to each parameter.
    noise : ndarray, shape (variants, unlogged rows)
        What is added to the noise of the rows that were not logged.

    Returns
    -------
    ndarray, shape (variants, rows)
        Without noise. At no change, the true path.
    """
    vehicle, lost = run.vehicle, np.flatnonzero(~run.logged)
    none = np.zeros(len(noise))
    gain = vehicle.gain + changed.get("gain", none)
    arrivals = run.arrivals + changed.get("delay", none)[:, None]
    lags: Sequence[float | Array] = vehicle.lags
    if "lag" in changed:
        lags = (vehicle.lags[0] + changed["lag"][:, None],)
    level, trim = changed.get("level", none), changed.get("trim", none)
    rest = run.path - vehicle.gain * response(run.times, run.arrivals, run.command, vehicle.lags)
    commands = np.tile(run.command, (len(noise), 1))
    found = np.empty((len(noise), run.times.size))
    for k, time in enumerate(run.times):
        jumps = np.diff(commands[:, :k], axis=1, prepend=0.0)
        moved = np.sum(jumps * ramp(time - arrivals[:, :k], lags), axis=1)
        found[:, k] = rest[k] + gain * moved + level + trim * time
        if not run.logged[k]:
            measured = found[:, k] + run.measured[k] - run.path[k]
            measured += noise[:, np.searchsorted(lost, k)]
            law = vehicle.Kp * (run.reference[k] - measured)
            commands[:, k] = np.clip(law, -LIMIT, LIMIT)
    return found


def response(times: Array, arrivals: Array, command: Array, lags: tuple[float, ...]) -> Array:
    """Response of the plant of unit gain to commands that all arrive."""
    return ramp(times[:, None] - arrivals, lags) @ np.diff(command, prepend=0.0)


def covariance(condition: Condition, run: Run) -> Array:
    """Covariance of measured minus mean output, of all rows as if all were logged."""
    size = run.times.size
    found = np.diag(white_variances(condition, run))
    if condition.correlation:
        lags = np.arange(size)
        found += CORRELATED**2 * condition.correlation ** abs(lags[:, None] - lags)
    if condition.air or condition.gust is not None:
        found += air_covariance(condition, sum(run.vehicle.lags), run.times)
    return found


def white_variances(condition: Condition, run: Run) -> Array:
    """Variance of each row's noise; of a rounded row, the inverse of its Fisher information.

    A row that is rounded to r has the probability P = F((r + q/2 - y) / w) - F((r - q/2 - y) / w),
    and the information is the sum of (dP/dy)^2 / P over r.
    """
    white, quantum = condition.white, condition.quantum
    if not quantum:
        return np.full(run.times.size, white**2)
    edges = (np.arange(-6.0, 7.0) + 0.5) * quantum
    z = (quantum * np.round(run.path / quantum)[:, None] + edges - run.path[:, None]) / white
    P = np.diff(ndtr(z), axis=1)
    slope = np.diff(np.exp(-(z**2) / 2.0), axis=1) / math.sqrt(2.0 * math.pi) / white
    information = np.sum(np.where(P > 1e-30, slope**2 / np.maximum(P, 1e-30), 0.0), axis=1)
    return 1.0 / np.maximum(information, 1e-6)


def air_covariance(condition: Condition, lag: float, times: Array) -> Array:
    """Covariance of the output that the air adds, from Itô's isometry.

    The output is the integral of h(t - s) dB(s), where h is the response to a shock of the air, and
    the covariance that of h(t - s) h(t' - s). The integrand is smooth between the rows, where it is
    summed by Gauss' formula. Gusts add what their state at time zero leads to.
    """
    nodes, weights = np.polynomial.legendre.leggauss(6)
    width = np.diff(times)
    s = (times[:-1, None] + np.outer(width, (nodes + 1.0) / 2.0)).ravel()
    weight = np.outer(width, weights / 2.0).ravel()
    age = np.maximum(times[:, None] - s, 0.0)
    lags = (lag,) if lag else ()
    if condition.gust is None:
        h = condition.air * ramp(age, lags)
        return (h * weight) @ h.T
    deviation, T = condition.gust
    h = deviation * math.sqrt(2.0 / T) * fading(age, lag, T)
    share = T / (T + lag)
    air, velocity = fading(times, lag, T), -lag * np.expm1(-times / (lag or 1.0))
    start = np.array([[1.0, share], [share, share]]) * deviation**2
    states = np.stack([air, velocity], axis=1)
    return (h * weight) @ h.T + states @ start @ states.T


def fading(age: Array, lag: float, T: float) -> Array:
    """Response of the plant of unit gain to exp(-t / T); T and lag differ."""
    return T + (lag * T * np.exp(-age / (lag or 1.0)) - T**2 * np.exp(-age / T)) / (T - lag)
