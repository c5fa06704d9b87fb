"""Delay from the limit cycle of an integrator under relay feedback (Åström & Hägglund 1984).

The output climbs with slope a until one delay after the command has switched, then falls with the
same slope: from one crossing c of the reference to the next, c', it takes 2 (s + Td - c), where s
is the time of the switch. Each half cycle gives Td = (c + c')/2 - s, a quarter of the period where
the relay switches at the crossing. A sampled relay switches at the next sample; where noise makes
it switch several times, s is the time of one switch with the same effect. Crossings are those of
lines fitted to the samples on the slope; the peak is a (s + Td - c).

A known lag is subtracted (exactly where the relay switches at the crossing, within a millisecond or
two where samples are as long as the lag). An unknown lag counts as delay: almost all of it where it
is shorter than a quarter of the period. Half cycles are averaged in pairs, in which an offset or a
drift cancels to first order; the standard error is that of the mean of these cycles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import positive
from deadtime.estimation.data._checks import integrator_of
from deadtime.estimation.data._step_reading import noise_of_second_differences
from deadtime.estimation.methods._method import OfOne, Read, Run
from deadtime.recordings import Recording

#: Crossings at the beginning that are left out: from rest, where noise alone switches the relay,
#: the limit cycle is not yet reached.
LEFT_OUT = 2

#: Fewest half cycles after these: a standard error takes two pairs.
FEWEST = 4

#: Largest relative standard deviation of the half cycles, and smallest ratio of the last peak to
#: the first, of a limit cycle.
UNEVEN, SHRINKING = 0.25, 0.7

#: Least share of the samples in which the command of a relay is at one of its two values.
AT_VALUES = 0.9


@dataclass(frozen=True)
class Relay(OfOne):
    """Delay from the period of a limit cycle under relay feedback.

    Parameters
    ----------
    amplitude : float, optional
        Amplitude of the relay, where the command was not logged; only the residuals need it.

    Raises
    ------
    ValueError
        When the amplitude is not above zero.
    """

    amplitude: float | None = None

    name: ClassVar[str] = "relay"
    limits: ClassVar[str] = (
        "The method counts a lag of the plant as delay. It also assumes that "
        "the slopes of the cycle are straight, so a drift biases the delay."
    )

    def __post_init__(self) -> None:
        if self.amplitude is not None:
            positive("amplitude", self.amplitude)

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        recording, loop, window, *_ = run
        plant = integrator_of(loop, "relay")
        data = recording.window(*window)
        signs, height = _relay(data, self.amplitude)
        error = data.output - data.reference
        # Second differences of straight lines are noise, except at the corners.
        noise = noise_of_second_differences(error)
        crossings = native.cycle_crossings(data.time, error, noise)[LEFT_OUT:]
        _check_cycle(crossings, error, data.time)
        switches = _switches(data.time, signs, crossings, loop.is_sampled)
        half = float(np.mean(np.diff(crossings)))
        count, mean, stderr = native.cycle_delays(crossings, switches)
        delay = mean - native.cycle_delay_by_lag(plant.lag, half)
        if delay <= 0.0:
            raise NotIdentifiableError(
                f"lag and hold explain a quarter of the period, {0.5 * half:.3g} s. "
                f"So the lag is shorter than {plant.lag:g} s, or there is no delay"
            )
        columns = data.time, data.output, data.reference
        found = native.cycle_path(columns, switches, delay, plant.lag)
        assert found is not None  # there are rows between the first and the last crossing
        ends, path, output, fitted = found
        first, last = data.time[ends].tolist()
        slope = abs(plant.gain) * height if height is not None else abs(fitted)
        waits = float(np.mean(switches - crossings[:-1]))
        peaks = native.cycle_peaks(data.time, error, crossings)
        return Read(
            {"delay": delay},
            stderr,
            float(output[0]),
            message=(
                f"{count} cycles of {2.0 * half:.4g} s; "
                + (f"the hold waits {waits:.2g} s on average, " if loop.is_sampled else "")
                + (f"a lag of {plant.lag:g} s subtracted" if plant.lag else "a lag counts as delay")
            ),
            uncalibrated=(
                f"the relay method gives the standard error of the mean of {count} cycles, "
                f"{stderr:.2g} s. A lag or a drift biases every cycle by the same amount. Use "
                "method='output_error' for an interval"
            ),
            details={
                "period": 2.0 * half,
                "cycles": count,
                "wait_of_hold": waits,
                "amplitude": float(peaks.mean()),
                "amplitude_expected": slope * (delay + waits),
                "slope": abs(fitted),
            },
            recording=data.window(first, last),
            residuals=output - math.copysign(slope, fitted) * path,
        )


def _relay(data: Recording, amplitude: float | None) -> tuple[Array, float | None]:
    """Sign of the command at every sample, and its amplitude where it is known."""
    error = data.reference - data.output
    if data.command is None:
        return np.where(error >= 0.0, 1.0, -1.0), amplitude
    size = float(np.median(np.abs(data.command)))
    at = np.abs(np.abs(data.command) - size) <= 0.01 * size
    if size == 0.0 or float(np.mean(at)) < AT_VALUES:
        raise NotIdentifiableError(
            "a relay command has two values, but this command is at "
            f"±{size:.3g} in only {100 * float(np.mean(at)):.0f} % of the "
            "samples. Use method='output_error', or run Experiment.relay"
        )
    return np.where(data.command >= 0.0, 1.0, -1.0), size


def _check_cycle(crossings: Array, error: Array, time: Array) -> None:
    """Refuse what is no sustained oscillation around the reference."""
    if float(np.ptp(error)) == 0.0:
        raise NotIdentifiableError("the output does not move, so there is no limit cycle")
    if crossings.size < FEWEST + 1:
        raise NotIdentifiableError(
            f"after the first {LEFT_OUT} crossings, the output crosses the "
            f"reference {crossings.size} times, but {FEWEST + 1} times are "
            "needed. Either there is no limit cycle, or the window is too short"
        )
    halves = np.diff(crossings)
    if float(np.std(halves)) > UNEVEN * float(np.mean(halves)):
        raise NotIdentifiableError(
            "the time between crossings of the reference varies from "
            f"{float(halves.min()):.3g} to {float(halves.max()):.3g} s. "
            "So this is noise or a changing reference, not a limit cycle"
        )
    peaks = native.cycle_peaks(time, error, crossings)
    if peaks[-1] < SHRINKING * peaks[0]:
        raise NotIdentifiableError(
            f"the oscillation decays from {peaks[0]:.3g} to {peaks[-1]:.3g}, so no "
            "relay sustains this oscillation. Use method='decrement' or 'waveform'"
        )


def _switches(time: Array, signs: Array, crossings: Array, sampled: bool) -> Array:
    """Time of the switch at each crossing but the last; the crossing itself without samples."""
    if not sampled:
        return crossings[:-1]
    counts, times = native.cycle_switches(time, signs, crossings)
    for count, crossing in zip(counts, crossings, strict=False):
        if count % 2 == 0:
            raise NotIdentifiableError(
                f"the command switches {count} times around the crossing at "
                f"{crossing:.3g} s. Either noise hides the limit cycle, or "
                "the command does not come from a relay. Use a larger relay"
            )
    return np.array(times)
