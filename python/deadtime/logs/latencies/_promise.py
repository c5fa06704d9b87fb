"""How well the rows of a log can tell the time of a loop, before anything is fitted.

Two things limit it. A setpoint changes at some time between two of its rows, at any of them with
the same probability: of n changes of like size the mean is known to h/sqrt(12 n), h the time
between rows less the period of the controller. And the response has noise: with residuals e of
variance v about g x(t - T), x the setpoint behind the best of a few lags,

    var(T) = v / (g^2 sum x'^2),

the Cramér-Rao bound, with the gain g free. Residuals that drift are made white first: of all
signals each row less rho times the row before, rho the lag-1 autocorrelation of the residuals. What
the few lags leave counts as noise, so that the number is rather too large than too small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import shown
from deadtime._base.plain import plain_fields
from deadtime.logs._log import Log, LogLoop
from deadtime.logs._series import Series
from deadtime.logs.latencies._commands import period_of
from deadtime.logs.latencies._correlation import Grid, correlated, grid_of, peak_of
from deadtime.logs.latencies._windows import LENGTHS, LONGEST

#: Lags that are tried, in rough times from setpoint to response.
LAGS = (0.0, 0.25, 0.5, 1.0, 2.0)

#: Least correlation of setpoint and response that shows a time: below, most of the response is
#: something else.
FOLLOWS = 0.3

#: Largest correlation of residuals from row to row: nearer to one, the gain is not determined.
DRIFTS = 0.999


@dataclass(frozen=True)
class Promise:
    """The standard error of the time from setpoint to response that the rows of a log permit.

    Attributes
    ----------
    rows : float
        The part that comes from the time between rows, s.
    noise : float
        The part that comes from the noise of the response, s; infinite where it does not follow.
    time : float
        That time, roughly, s; NaN where it is not seen.
    changes : float
        Changes of like size of the setpoint that these are equal to.
    """

    rows: float
    noise: float
    time: float
    changes: float

    @property
    def stderr(self) -> float:
        """Both parts together, s."""
        return math.hypot(self.rows, self.noise)

    def short(self) -> str:
        """The error alone, or a dash for none."""
        if not math.isfinite(self.stderr):
            return "–"
        return f"± {shown(self.stderr, 0.3 * self.stderr, 's')}"

    def line(self) -> str:
        """The error in one line."""
        if not math.isfinite(self.stderr):
            return "the response does not follow the setpoint in these rows, so there is no time"
        return f"{self.short()} with these rows"

    def to_dict(self) -> dict[str, Any]:
        """The error and its parts as plain values for JSON."""
        return plain_fields({"stderr": self.stderr, **vars(self)})


class _Best(NamedTuple):
    """The best of the tried lags: correlation, time, setpoint behind the lag by piece."""

    height: float
    time: float
    pieces: list[Array]


def promised(
    setpoint: Series,
    response: Series,
    segments: Sequence[tuple[float, float]],
    period: float | None = None,
    *,
    longest: float,
) -> Promise:
    """The standard error that these rows permit.

    Parameters
    ----------
    setpoint, response : Series
        Both signals of a loop.
    segments : sequence of (float, float)
        Where the setpoint is followed, s.
    period : float, optional
        Period of the controller, s; by default it is taken to be short against the rows.
    longest : float
        Longest time from setpoint to response that is looked for, s.

    Returns
    -------
    Promise
        Infinite where the setpoint rests or the response does not follow it.

    Examples
    --------
    >>> import numpy as np
    >>> from deadtime.logs import Series
    >>> from deadtime.logs.latencies import promised
    >>> time = np.arange(0.0, 60.0, 0.1)
    >>> asked = np.floor(time / 2.0) % 2.0
    >>> noise = 1e-3 * np.random.default_rng(1).standard_normal(600)
    >>> found = promised(
    ...     Series(time, asked, "rad", "asked"),
    ...     Series(time, np.roll(asked, 3) + noise, "rad", "response"),
    ...     [(0.0, 59.0)],
    ...     longest=1.0,
    ... )
    >>> found.changes, found.line()  # 0.1/sqrt(12 * 29) s
    (29.0, '± 5.4 ms with these rows')
    """
    inside = np.zeros(len(setpoint), dtype=bool)
    for low, high in segments:
        inside |= (setpoint.time >= low) & (setpoint.time <= high)
    changes = np.diff(setpoint.values[inside & np.isfinite(setpoint.values)]) ** 2
    power = float(np.sum(changes))
    if not power > 0.0:
        return Promise(math.inf, math.inf, math.nan, 0.0)
    count = power**2 / float(np.sum(changes**2))
    hidden = max(0.0, setpoint.period - (period or 0.0))
    grid = grid_of(setpoint, response, segments, held=False)
    noise, time = _noise(grid, response.period, longest)
    return Promise(hidden / math.sqrt(12.0 * count), noise, time, count)


def promises_of(log: Log) -> dict[str, Promise]:
    r"""How well the rows of each loop of a log can tell its time, before anything is fitted.

    Parameters
    ----------
    log : Log

    Returns
    -------
    dict of str to Promise
        By the names of the loops; without those that are never followed.

    Examples
    --------
    >>> import deadtime as dtm, pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "flight.log"
    >>> lines = ["FMT, 1, 23, ATT, Qcc, TimeUS,DesRoll,Roll"]
    >>> lines += [f"ATT, {k * 100000}, {k % 20 // 10}, {(k - 3) % 20 // 10}" for k in range(300)]
    >>> _ = file.write_text("\n".join(lines))
    >>> log = dtm.open_log(file)
    >>> {name: promise.line() for name, promise in dtm.logs.promises_of(log).items()}
    {'roll': '± 5.4 ms with these rows'}
    """
    return {loop.name: _of_loop(log, loop) for loop in log.loops.values() if loop.segments}


def _of_loop(log: Log, loop: LogLoop) -> Promise:
    known = period_of(log, loop.kind)
    return promised(
        loop.setpoint, loop.response, loop.segments, None if known is None else known.time,
        longest=LONGEST * LENGTHS[loop.kind],
    )  # fmt: skip


def _noise(grid: Grid, row: float, longest: float) -> tuple[float, float]:
    """Standard error from the noise of the response, and the time, roughly; s."""
    best = _best(grid, [piece.asked for piece in grid.pieces], longest)
    rough = max(best.time, 2.0 * grid.step) if math.isfinite(best.time) else 0.25 * longest
    for share in LAGS[1:]:
        behind = [_lagged(piece.asked, share * rough / grid.step) for piece in grid.pieces]
        found = _best(grid, behind, longest)
        if found.height > best.height:
            best = found
    if not (best.height > FOLLOWS and math.isfinite(best.time)):
        return math.inf, math.nan
    late, every = round(best.time / grid.step), max(1, round(row / grid.step))
    asked, responses, slopes = [], [], []
    for piece, behind_it in zip(grid.pieces, best.pieces, strict=True):
        moved = behind_it[: max(0, behind_it.size - late)]
        if moved.size < 2:
            continue
        asked.append(moved[::every])
        responses.append(piece.response[late:][::every])
        slopes.append(np.gradient(moved, grid.step)[::every])
    x, y, slope = (np.concatenate(parts) for parts in (asked, responses, slopes))
    x, y, slope = x - x.mean(), y - y.mean(), slope - slope.mean()
    left = y - float(x @ y) / float(x @ x) * x
    square = max(float(left @ left), 1e-300)
    rho = float(np.clip(left[1:] @ left[:-1] / square, 0.0, DRIFTS))
    x, y, slope = (values[1:] - rho * values[:-1] for values in (x, y, slope))
    gain = float(x @ y) / float(x @ x)
    left = y - gain * x
    slope = slope - x * (float(x @ slope) / float(x @ x))
    information = gain**2 * float(slope @ slope)
    if not information > 0.0:
        return math.inf, math.nan
    variance = float(left @ left) / left.size
    return math.sqrt(variance / information), rough


def _best(grid: Grid, asked: list[Array], longest: float) -> _Best:
    """The correlation of the response with a setpoint behind a lag."""
    lags, found = _crossed(asked, [piece.response for piece in grid.pieces], grid.step, longest)
    size = math.sqrt(sum(float(values @ values) for values in asked))
    size *= math.sqrt(sum(float(piece.response @ piece.response) for piece in grid.pieces))
    if not size > 0.0:
        return _Best(-math.inf, math.nan, asked)
    time, height = peak_of(lags, found / size)
    return _Best(height, time, asked)


def _crossed(
    asked: list[Array], responses: list[Array], step: float, longest: float
) -> tuple[Array, Array]:
    """Sums of asked(t - lag) response(t) over all pieces, by lag from one step ahead, s."""
    count = round(longest / step)
    total = np.zeros(count + 2)
    for x, y in zip(asked, responses, strict=True):
        total += correlated(np.pad(y, (1, count)), x)
    return np.asarray((np.arange(total.size) - 1) * step), total


def _lagged(values: Array, rows: float) -> Array:
    """A signal behind one lag of so many rows, at rest before its first value."""
    from scipy.linalg import solve_banded

    decay = math.exp(-1.0 / max(rows, 1e-3))
    bands = np.stack([np.ones(values.size), np.full(values.size, -decay)])
    return np.asarray(solve_banded((1, 0), bands, np.append(values[0], (1.0 - decay) * values[1:])))
