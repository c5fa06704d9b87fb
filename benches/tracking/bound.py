"""The posterior Cramér-Rao bound of a delay that walks, and the bound of a window.

P. Tichavský, C. H. Muravchik and A. Nehorai, "Posterior Cramér-Rao bounds for discrete-time
nonlinear filtering", IEEE Transactions on Signal Processing 46 (1998): with Gaussian noise the bound
is the covariance that the extended Kalman filter would have if it knew where to linearise, at the
true states. The states are speed, height, gust, gain and delay; the derivatives of the row are
taken numerically at the truth of each run, given its commands.
"""

from __future__ import annotations

import numpy as np

from tracking.runs import SAMPLE, Array, Runs, Vehicle, of_row, step_response

#: Step of the central differences, s.
STEP = 1e-5


def slopes_of_rows(runs: Runs) -> tuple[Array, Array]:
    """What the input adds to (speed, height) in each row at a gain of one, and its derivative.

    Both have the shape (rows, runs, 2).
    """
    count, rows = runs.command.shape
    jumps = np.diff(runs.command, axis=1, prepend=0.0)
    found = np.zeros((3, rows, count, 2))
    back = int(np.ceil(float(np.max(runs.delay)) / SAMPLE)) + 3
    # What held before a row counts in full; the jumps in it count for the rest of the row. A jump
    # that has arrived by its end stays so when the delay is moved by a small step.
    whole = step_response(np.full(1, SAMPLE), runs.vehicle.lag)
    for k in range(1, rows):
        low = max(0, k - back)
        age = runs.time[k] - (runs.time[low:k] + runs.delay[:, low:k])
        inside = (age >= 0.0) & (age < SAMPLE)
        old = np.sum(jumps[:, :low], axis=1) + np.sum(
            np.where(age >= SAMPLE, jumps[:, low:k], 0.0), axis=1
        )
        for place, shift in enumerate((0.0, STEP, -STEP)):
            moved = step_response(np.maximum(age - shift, 0.0), runs.vehicle.lag)
            for i in range(2):
                found[place, k, :, i] = old * whole[i][0] + np.sum(
                    np.where(inside, jumps[:, low:k] * moved[i], 0.0), axis=1
                )
    return found[0], (found[1] - found[2]) / (2.0 * STEP)


def posterior_bound(runs: Runs, drift: float, first: float, gain: float) -> Array:
    """Least standard deviation of the delay at each row, shape (runs, rows).

    `first` and `gain` are the deviations of delay and gain before the first row.
    """
    count, rows = runs.command.shape
    phi, root = of_row(runs.vehicle)
    by_gain, by_delay = slopes_of_rows(runs)
    noise = np.zeros((5, 5))
    noise[:3, :3] = root @ root.T
    noise[4, 4] = drift**2 * SAMPLE
    P = np.zeros((count, 5, 5))
    P[:] = np.diag([0.0, 1.0, runs.vehicle.gust**2, gain**2, first**2])
    found = np.zeros((count, rows))
    for k in range(rows):
        if k:
            F = np.zeros((count, 5, 5))
            F[:] = np.eye(5)
            F[:, :3, :3] = phi
            F[:, :2, 3] = by_gain[k]
            F[:, :2, 4] = runs.vehicle.gain * by_delay[k]
            P = F @ P @ F.transpose(0, 2, 1) + noise
        seen = P[:, :, 1]
        P = P - seen[:, :, None] * seen[:, None, :] / (
            seen[:, 1] + runs.vehicle.white**2
        ).reshape(-1, 1, 1)
        found[:, k] = np.sqrt(P[:, 4, 4])
    return found


def window_bound(runs: Runs, first: int, last: int) -> Array:
    """Cramér-Rao bound of the delay from rows `first` to `last` alone, shape (runs,).

    Delay, gain, level and speed at the start are unknown.
    """
    part = Runs(
        runs.vehicle,
        runs.time[first:last],
        *(getattr(runs, name)[:, first:last] for name in ("reference", "output", "command", "delay")),
    )
    count = part.command.shape[0]
    by_gain, by_delay = (one[first:last] for one in slopes_of_rows(runs))
    phi, root = of_row(runs.vehicle)
    noise = np.zeros((5, 5))
    noise[:3, :3] = root @ root.T
    P = np.zeros((count, 5, 5))
    P[:] = np.diag([1.0, 1.0, runs.vehicle.gust**2, 1.0, 1.0])
    for k in range(part.time.size):
        if k:
            F = np.zeros((count, 5, 5))
            F[:] = np.eye(5)
            F[:, :3, :3] = phi
            F[:, :2, 3] = by_gain[k]
            F[:, :2, 4] = runs.vehicle.gain * by_delay[k]
            P = F @ P @ F.transpose(0, 2, 1) + noise
        seen = P[:, :, 1]
        P = P - seen[:, :, None] * seen[:, None, :] / (
            seen[:, 1] + runs.vehicle.white**2
        ).reshape(-1, 1, 1)
    return np.sqrt(P[:, 4, 4])
