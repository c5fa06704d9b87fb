"""Half of the step response of a setpoint by Wiener deconvolution in windows.

As PID-Analyzer does it (Plasmatree), with one difference: the spectra of the windows are averaged
before they are divided, which leaves less noise than the mean of many quotients. With windows
x_w, y_w under a Hann window, half over one another, and their transforms X_w, Y_w,

    H = sum conj(X_w) Y_w / (sum |X_w|^2 + c max sum |X_w|^2),

and the step response is the sum of the impulse response of H. Its time is that at which it passes
half of its level over the second half of the times that are kept. Of a plant of one lag that is
delay + 0.69 lag. What the same division makes of the setpoint itself has to be a step that rises
faster than the time found: a setpoint that moves at few frequencies gives none.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.digits import stated
from deadtime.logs.latencies._correlation import BLOCKS, Grid
from deadtime.logs.latencies._setpoint_moves import below_half

Spectrum: TypeAlias = NDArray[np.complex128]

#: Regularisation c as a share of the largest power of the setpoint: it takes out frequencies at
#: which the setpoint has little power, and smooths the step to both sides alike.
REGULARISED = 1e-3

#: Length of a window in longest times from setpoint to response: long against these, so that the
#: window weighs setpoint and response alike, and short, so that there are many.
WINDOW = 3.0

#: How far the step of the setpoint itself may lie off one over the second half.
FLAT = 0.2

#: Ends of its rise.
RISE = (0.25, 0.75)

#: What of the step is kept before zero, as a share of the longest time.
AHEAD = 0.25


def half_of_step(grid: Grid, longest: float) -> tuple[float, Array, int, str]:
    """Time of half of the step, that without each group of windows, their number, and why not."""
    crosses, powers = _spectra(grid, longest)
    count = len(powers)
    if count == 0:
        return math.nan, np.empty(0), 0, "no part of the log is long enough"
    cross, power = crosses.sum(axis=0), powers.sum(axis=0)
    if not float(np.max(power)) > 0.0:
        return math.nan, np.empty(0), count, "the setpoint does not move"
    time, own = _step(power, power, grid.step, longest)
    if float(np.max(np.abs(own[time >= 0.5 * longest] - 1.0))) > FLAT:
        return (
            math.nan,
            np.empty(0),
            count,
            ("the setpoint moves at too few frequencies to compute a step response"),
        )
    found = _half(cross, power, grid.step, longest)
    rise = float(np.sum((own > RISE[0]) & (own < RISE[1]))) * grid.step
    if rise > found:
        why = (
            f"the computed step of the setpoint rises over {stated(rise, 0.0, 's')}, which is "
            "too slow to read a time"
        )
        return math.nan, np.empty(0), count, why
    groups = np.array_split(np.arange(count), min(BLOCKS, count))
    without = [
        _half(cross - crosses[k].sum(axis=0), power - powers[k].sum(axis=0), grid.step, longest)
        for k in (groups if len(groups) > 1 else ())
    ]
    why = (
        ("the deconvolved step response does not come to rest at a level")
        if math.isnan(found)
        else ""
    )
    return found, np.array(without), count, why


def _spectra(grid: Grid, longest: float) -> tuple[Spectrum, Array]:
    """conj(X) Y and |X|^2 of each window, shape (windows, frequencies)."""
    from numpy.lib.stride_tricks import sliding_window_view
    from scipy.fft import next_fast_len

    rows = max(8, round(WINDOW * longest / grid.step))
    size = next_fast_len(2 * rows, real=True)
    weight = np.hanning(rows)
    crosses, powers = [], []
    for piece in grid.pieces:
        if piece.asked.size < rows:
            continue
        asked, response = (
            np.fft.rfft(sliding_window_view(part, rows)[:: rows // 2] * weight, size)
            for part in (piece.asked, piece.response)
        )
        crosses.append(np.conj(asked) * response)
        powers.append(np.abs(asked) ** 2)
    if not crosses:
        return np.empty((0, 0), complex), np.empty((0, 0))
    return np.concatenate(crosses), np.concatenate(powers)


def _step(cross: Spectrum, power: Array, step: float, longest: float) -> tuple[Array, Array]:
    """The step response by time, s."""
    least = REGULARISED * float(np.max(power))
    impulse = np.fft.irfft(cross / (power + least))
    ahead, after = round(AHEAD * longest / step), round(longest / step)
    kept = np.concatenate([impulse[impulse.size - ahead :], impulse[: after + 1]])
    # A sum up to a point holds the impulse half a step beyond it.
    time = (np.arange(kept.size) - ahead + 0.5) * step
    return np.asarray(time), np.asarray(np.cumsum(kept), dtype=float)


def _half(cross: Spectrum, power: Array, step: float, longest: float) -> float:
    """Time at which the step passes half of its level, s."""
    time, response = _step(cross, power, step, longest)
    level = float(np.median(response[time >= 0.5 * longest]))
    if not level > 0.0:
        return math.nan
    found = float(time[0]) + below_half(time, response / level)
    return found if found < 0.5 * longest else math.nan
