"""The least error with which a log lets the time from setpoint to response be known.

Rows of the response are r = gain G u + offset + trim t + noise. The setpoint u is known at its
rows. Between them it is a straight line plus a jump at a time that is uniform over the row: its
deviation from the line has the covariance of a Brownian bridge,

    cov(x, y) = v (min(x, y) - x y),    0 < x, y < 1,

and passes through the plant into the covariance of the noise. Of it, the area has the variance
v h²/12. v is two thirds of the square of what a change over a row has beyond the mean of its
neighbours: the square of a lone jump, spread over three rows, or the mean square of changes that
know nothing of one another. Where a row follows each sample of the controller, nothing is unknown.

The bound is that of generalised least squares for gain, offset, trim, delay, and the other numbers
of the true class of plant. The log is cut into blocks, each with an offset and a trim of its own
and taken as independent; rows that are dense against the time are averaged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from flown_logs import Flown
from flown_plants import FREE, Plant
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

#: Rows of a block: a few hundred, as a dense matrix costs their cube. Those left at the end are
#: left out if they are fewer than this.
BLOCK, SHORTEST = 400, 50

#: Rows are averaged up to this share of the time.
AVERAGED = 0.125

#: Pieces of a row between which an unknown setpoint varies: two are within 2 % of many.
PIECES = 4

#: A jump below this share of the white noise of a row is known: a thousand of them add 1 %.
KNOWN = 0.02

#: A row longer than this many usual ones is a pause, in which the setpoint moves as it pleases.
PAUSE = 2.5

#: Times after which a plant has forgotten its input, and relative step of differences.
MEMORY, STEP = 6.0, 1e-4

#: A slope in errors of a row that rounding leaves of a setpoint at rest, and the condition of an
#: information, with numbers of like size, that is singular to rounding.
NOTHING, SINGULAR = 1e-30, 1e12

#: Mean square of a change less the mean of its neighbours, for changes of unit variance.
BEYOND = 1.5


@dataclass(frozen=True)
class Bound:
    """Standard error of the time, s: of the whole log, and of its best block alone."""

    error: float
    block: float


def bound_of(flown: Flown, omega: Array | None = None, weight: Array | None = None) -> Bound:
    """The bound of a flight at its truth: for its mean equivalent delay, weighted over frequencies.

    Without frequencies, rad/s, for that as the frequency goes to zero.
    """
    turn = _turn(flown.plant, np.zeros(1) if omega is None else omega, weight)
    whole = np.zeros((turn.size, turn.size))
    best = np.inf
    for slopes, _ in _blocks(flown, flown.plant):
        part = slopes.T @ slopes
        whole += part
        best = min(best, _error(part, turn))
    return Bound(_error(whole, turn), best)


def likeliest_time(flown: Flown, steps: int = 3) -> float:
    """Maximum likelihood of the time with known noise, by Gauss-Newton steps from the truth."""
    plant = flown.plant
    for _ in range(steps):
        information, score = 0.0, 0.0
        for slopes, left in _blocks(flown, plant):
            information, score = information + slopes.T @ slopes, score + slopes.T @ left
        change = np.linalg.solve(information, score)
        plant = _moved(plant, change)
    return plant.time


def _names(plant: Plant) -> tuple[str, ...]:
    return ("gain", *FREE[plant.kind])


def _turn(plant: Plant, omega: Array, weight: Array | None) -> Array:
    """How the mean equivalent delay changes with each free number."""
    time = plant.time
    size = {"gain": 1.0, "square": time**2}
    slopes = []
    for k, name in enumerate(_names(plant)):
        step = STEP * size.get(name, time)
        change = step * np.eye(len(_names(plant)))[k]
        ahead, behind = (_moved(plant, way * change).delay_at(omega) for way in (1.0, -1.0))
        slopes.append(np.average(ahead - behind, weights=weight) / (2.0 * step))
    return np.array(slopes)


def _moved(plant: Plant, change: Array) -> Plant:
    numbers = {
        name: getattr(plant, name) + float(by)
        for name, by in zip(_names(plant), change, strict=True)
    }
    return replace(plant, **numbers)


def _error(information: Array, turn: Array) -> float:
    """Standard error of the time; infinite where the information is singular."""
    scale = np.sqrt(np.diag(information))
    if not np.all(scale > NOTHING):
        return np.inf
    scaled = information / np.outer(scale, scale)
    if np.linalg.cond(scaled) > SINGULAR:
        return np.inf
    along = turn / scale
    return float(np.sqrt(along @ np.linalg.solve(scaled, along)))


def _blocks(flown: Flown, plant: Plant) -> Iterator[tuple[Array, Array]]:
    """Slopes and residuals of each block, white, without what offset and trim explain.

    The covariance is that of the truth, the slopes are those of `plant`.
    """
    groups, stride = _grouped(flown)
    inputs = np.interp(np.arange(flown.inputs.size), flown.asked, flown.setpoint)
    slopes, left = _slopes(flown, plant, inputs)
    slopes, left = (np.mean(each[groups], axis=1) for each in (slopes, left))
    rows, times = flown.read[groups[:, 0]], np.mean(flown.read_at[groups], axis=1)
    noise = _averaged_noise(flown, groups.shape[1], stride, int(np.ptp(flown.read)))
    for first in range(0, rows.size, BLOCK):
        part = slice(first, first + BLOCK)
        at = times[part]
        if (at.size < BLOCK // 4 and first > 0) or not np.any(slopes[part, 0] != slopes[first, 0]):
            continue
        covariance = noise[np.abs(rows[part, None] - rows[None, part])]
        unknown = _unknown(flown, at)
        covariance += unknown @ unknown.T
        trend = np.stack([np.ones(at.size), (at - at.mean()) / np.ptp(at)], axis=1)
        root = cholesky(covariance, lower=True)
        whole = np.column_stack([trend, slopes[part], left[part]])
        white = solve_triangular(root, whole, lower=True)
        basis, _ = np.linalg.qr(white[:, :2])
        white = white[:, 2:] - basis @ (basis.T @ white[:, 2:])
        yield white[:, :-1], white[:, -1]


def _grouped(flown: Flown) -> tuple[Rows, int]:
    """Rows of the response that are averaged, shape (n, together), and the samples between two."""
    gaps = np.diff(flown.read)
    stride = int(np.median(gaps))
    together = max(1, int(AVERAGED * flown.plant.time * flown.case.sensor / stride))
    count = flown.read.size // together
    groups = np.arange(count * together).reshape(count, together)
    lengths = flown.read[groups[:, -1]] - flown.read[groups[:, 0]]
    return groups[lengths <= (together - 1) * stride + 2], stride


def _averaged_noise(flown: Flown, together: int, stride: int, longest: int) -> Array:
    """Covariance of averages of rows by the samples between their first ones."""
    longest += together * stride
    single = flown.noise.covariance(flown.plant)(np.arange(longest + 1) / flown.case.sensor)
    lags = np.arange(longest - together * stride + 1)
    found = np.zeros(lags.size)
    for row in range(1 - together, together):
        found += (together - abs(row)) / together**2 * single[np.abs(lags + row * stride)]
    return found


def _slopes(flown: Flown, plant: Plant, inputs: Array) -> tuple[Array, Array]:
    """Slopes of the response with each free number at its rows, and what it leaves of them."""
    times, period = flown.read_at, 1.0 / flown.case.controller
    size = {"gain": 1.0, "square": plant.time**2}
    slopes = []
    for k, name in enumerate(_names(plant)):
        step = STEP * size.get(name, plant.time)
        change = step * np.eye(len(_names(plant)))[k]
        ahead, behind = (
            _moved(plant, way * change).response(times, period, inputs) for way in (1.0, -1.0)
        )
        slopes.append((ahead - behind) / (2.0 * step))
    left = flown.response - plant.response(times, period, inputs)
    return np.stack(slopes, axis=1), left


def _unknown(flown: Flown, times: Array) -> Array:
    """Factor of the covariance at these times by the setpoint between its rows."""
    start = times[0] - flown.plant.delay - MEMORY * flown.plant.time
    rows, beyond = _beyond(flown)
    at, until = flown.asked[rows], flown.asked[rows + 1]
    kept = (until >= start * flown.case.controller) & (at < times[-1] * flown.case.controller)
    first, last, size = at[kept], until[kept], beyond[kept]
    if first.size == 0:
        return np.zeros((times.size, 1))
    # The unknown samples are those after the first and before the last.
    share = np.linspace(0.0, 1.0, PIECES + 1)
    edges = first[:, None] + 1.0 + (last - first - 1.0)[:, None] * share
    place = 0.5 * (edges[:, 1:] + edges[:, :-1]) - 0.5 - first[:, None]
    place /= (last - first)[:, None]
    bridge = np.minimum(place[:, :, None], place[:, None, :])
    bridge -= place[:, :, None] * place[:, None, :]
    roots = np.linalg.cholesky(bridge)
    risen = flown.plant.step(times[:, None, None] - edges / flown.case.controller)
    pulses = flown.plant.gain * (risen[:, :, :-1] - risen[:, :, 1:])
    factor = np.einsum("nkp,kpq->nkq", pulses * size[:, None], roots)
    return np.asarray(factor.reshape(times.size, -1))


def _beyond(flown: Flown) -> tuple[Rows, Array]:
    """Rows of the setpoint after which it is unknown, and the deviation of their jumps."""
    gaps = np.diff(flown.asked)
    slope = np.diff(flown.setpoint) / gaps
    around = np.concatenate([slope[:1], slope, slope[-1:]])
    size = np.abs(slope - 0.5 * (around[:-2] + around[2:])) * gaps / np.sqrt(BEYOND)
    size[gaps > PAUSE * np.median(gaps)] += 2.0 * np.std(flown.setpoint)
    rows = np.flatnonzero((gaps > 1) & (size > KNOWN * flown.noise.white))
    return rows, size[rows]
