"""What loops with new gains do: the response to the record's own set point, and to its own load.

A band holds the responses of all plants that an estimate leaves possible, and the noise that it
leaves unexplained, twice its standard deviation on either side. A load goes through the dead time
of the plant as a command does, and an estimate counts its time from where it begins there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime._base.frozen import ReadOnlyArrays
from deadtime.estimation import PlantEstimate
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: Standard deviations of the unexplained noise on either side of a band: 95 % of it.
NOISE = 2.0

#: Points of a predicted response.
POINTS = 600

#: How long a predicted response lasts, in times of the plant's delay and lags together.
LASTS = 8.0

#: Size of a load, as a share of the range of the command, where the record holds none.
SHARE = 0.25


@dataclass(frozen=True, eq=False)
class Prediction(ReadOnlyArrays):
    """A predicted response, in the units and on the clock of the recording.

    Attributes
    ----------
    kind : {"set point", "load"}
        What moves.
    size : float
        Of the move: in units of the output for a set point, of the command for a load.
    start : float
        When it moves, s.
    time : ndarray, shape (n,)
        Times, s.
    target : ndarray, shape (n,)
        The set point.
    outputs : ndarray, shape (n,)
        Output of the likeliest plant.
    low, high : ndarray, shape (n,)
        Ends of the band.
    """

    kind: Literal["set point", "load"]
    size: float
    start: float
    time: Array
    target: Array
    outputs: Array
    low: Array
    high: Array

    @property
    def peak(self) -> float:
        """Largest distance of the likeliest output from the level before the move."""
        return float(np.max(np.abs(self.outputs - self.outputs[0])))


def banded(outputs: Sequence[Array], noise: float) -> tuple[Array, Array]:
    """Ends of the band around outputs of several loops."""
    spread = NOISE * noise
    return np.min(outputs, axis=0) - spread, np.max(outputs, axis=0) + spread


def predicted_set_point(
    fit: PlantEstimate, loops: Sequence[ControlLoop]
) -> tuple[Prediction, bool]:
    """The response to the record's set point, and whether it has one that moves.

    Of a record without, to a step as large as the output's own change.
    """
    record = fit.recording
    reference = record.reference
    follows = record.has_reference and bool(np.ptp(reference) > 0.0)
    if follows:
        time, target = record.time, reference
        start = float(time[np.flatnonzero(target != target[0])[0]])
        size = float(target[np.argmax(np.abs(target - target[0]))] - target[0])
    else:
        start, size = _bump(fit)[0], _change(fit)
        time = np.linspace(start, start + _duration(fit), POINTS)
        level = float(np.nanmedian(record.output[record.time <= start]))
        target = np.full(POINTS, level + size)
    level = float(target[0]) if follows else float(target[0] - size)
    outputs = [
        level + loop.simulate(time, target - level, reference_time=time).outputs for loop in loops
    ]
    low, high = banded(outputs, fit.noise_std)
    return Prediction("set point", size, start, time, target, outputs[0], low, high), follows


def predicted_load(fit: PlantEstimate, loops: Sequence[ControlLoop]) -> tuple[Prediction, bool]:
    """The response to a load, and whether the record shows one that began then.

    Of a record without, to one as large as its own change of the command.
    """
    record = fit.recording
    load = next(
        (cause for cause in fit.causes if cause.name == "load" and cause.time is not None), None
    )
    if load is not None and load.time is not None:
        start, size, seen = load.time, load.size, True
    else:
        start, size = _bump(fit)
        seen = not record.has_reference
        if not seen:
            size *= SHARE
    end = start + _duration(fit)
    time = np.linspace(start, _end(record, start, end) if seen else end, POINTS)
    before = record.time <= start
    level = float(np.nanmedian(record.output[before][-_few(before) :]))
    outputs = [level + _after_load(loop, time - start, size) for loop in loops]
    low, high = banded(outputs, fit.noise_std)
    target = np.full(POINTS, level)
    return Prediction("load", size, start, time, target, outputs[0], low, high), seen


def _end(record: Recording, start: float, end: float) -> float:
    """Where a load's response ends: before the set point moves next."""
    if not record.has_reference:
        return end
    moves = record.time[1:][np.diff(record.reference) != 0.0]
    return float(min([end, *moves[moves > start]]))


def _after_load(loop: ControlLoop, since: Array, size: float) -> Array:
    """The output's deviation after a load that goes through the dead time, as a command does."""
    late = since - (loop.delay or 0.0)
    after = late > 0.0
    outputs = np.zeros(since.size)
    if np.any(after):
        times = np.concatenate([[0.0], late[after]])
        outputs[after] = loop.load_response(times, size).outputs[1:]
    return outputs


def _few(before: Mask) -> int:
    """How many rows before a move tell the level: the last tenth of them."""
    return max(1, int(0.1 * np.count_nonzero(before)))


def _bump(fit: PlantEstimate) -> tuple[float, float]:
    """When the command makes its largest change, and its largest distance from its beginning."""
    record: Recording = fit.recording
    command = np.asarray(record.command)
    place = int(np.argmax(np.abs(np.diff(command)))) + 1
    moved = command - command[0]
    return float(record.time[place]), float(moved[np.argmax(np.abs(moved))])


def _change(fit: PlantEstimate) -> float:
    """Largest distance of the fitted output from its beginning."""
    fitted = fit.fitted[np.isfinite(fit.fitted)]
    moved = fitted - fitted[0]
    return float(moved[np.argmax(np.abs(moved))])


def _duration(fit: PlantEstimate) -> float:
    return LASTS * max(fit.delay_plus_lag, fit.delay, 1e-9)
