"""The scheme of openpilot's estimator of the steering delay (`lagd`), written anew.

The normalised cross-correlation of what was asked for and what came, over the last 60 s and where
both are there, has its peak at the lag; a parabola through it gives parts of a row. The peaks count
where the correlation is high, and their means over blocks are averaged. It has no interval.
"""

from __future__ import annotations

import numpy as np

from tracking.runs import SAMPLE, Array

#: Window, longest lag, time between estimates, s.
WINDOW, LONGEST, BETWEEN = 60.0, 1.0, 0.25

#: Least correlation; estimates a block, blocks that are kept, and that are needed.
LEAST, BLOCK, KEPT, NEEDED = 0.95, 100, 50, 5


def peak(command: Array, speed: Array, seen: Array) -> tuple[float, float]:
    """Lag in rows at which the masked normalised correlation is largest, and its size there."""
    lags = int(LONGEST / SAMPLE)
    found = np.zeros(lags + 1)
    for lag in range(lags + 1):
        both = seen[lag:] & seen[: seen.size - lag]
        x, y = command[: command.size - lag][both], speed[lag:][both]
        x, y = x - x.mean(), y - y.mean()
        found[lag] = x @ y / np.sqrt(max((x @ x) * (y @ y), 1e-300))
    best = int(np.argmax(found))
    if not 0 < best < lags:
        return float(best), float(found[best])
    low, middle, high = found[best - 1 : best + 2]
    bend = low - 2.0 * middle + high
    return best + (0.5 * (low - high) / bend if bend < 0.0 else 0.0), float(middle)


def track(
    output: Array, command: Array, seen: Array | None = None, least: float = LEAST
) -> tuple[Array, Array]:
    """The estimate after each row and the plain peak there, s; NaN where there is none.

    The speed is the difference of neighbouring heights, and half a row early.
    """
    speed = np.diff(output, prepend=output[0]) / SAMPLE
    seen = np.ones(output.size, dtype=bool) if seen is None else seen
    window, step = int(WINDOW / SAMPLE), max(1, round(BETWEEN / SAMPLE))
    blocks: list[float] = []
    block: list[float] = []
    shown, peaks = np.full((2, output.size), np.nan)
    for row in range(window, output.size):
        if row % step == 0:
            part = slice(row - window, row)
            lag, size = peak(command[part], speed[part], seen[part])
            if size >= least:
                peaks[row] = (lag - 0.5) * SAMPLE
                block.append(peaks[row])
                if len(block) == BLOCK:
                    blocks = [*blocks, float(np.mean(block))][-KEPT:]
                    block = []
        shown[row] = np.mean(blocks) if len(blocks) >= NEEDED else np.nan
    return shown, peaks
