"""Delay from how a response oscillates: its peaks, or its limit cycle.

`Decrement`, logarithmic: delay and gain from successive peaks and valleys of a step response.

Once the other modes have decayed, the step response oscillates as e^(-σt) cos(ω_d t + φ) with the
rightmost pair s = -σ ± iω_d. Its extremes follow each other after π/ω_d, each e^(-σπ/ω_d) times
the one before (Armah & Yi's eq. 4): a line through the logarithms of their heights and one through
their times give σ and ω_d. The pair is a root of s (lag s + 1) + K e^(-s Td) = 0, two real
equations: with cos φ = σ/abs(s) and no lag, Td = φ/ω_d and K = ω_d e^(-σ Td)/sin φ, whatever the
gain. In a sampled loop 1 + K H(e^(s h); Td) = 0, H the held plant, takes its place. A known
gain is used by conditioning: with the covariance C of (Td, K), Td moves by C_TK/C_KK (K_known - K).

Only peaks at which the command is within its limit are used. The other modes contribute some per
cent to the first of them, and less to each that follows.

`Relay`: the limit cycle of an integrator under relay feedback (Åström & Hägglund 1984).

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
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import deadtime.estimation._native as native
import deadtime.estimation.data._step_reading as steps
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import positive
from deadtime.estimation.data._checks import delay_and, integrator_of
from deadtime.estimation.methods._method import OfOne, Read, Run
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording, noise_of_second_differences


@dataclass(frozen=True)
class Decrement(OfOne):
    """Delay, and gain if it is free, from the decay of successive peaks and valleys."""

    name: ClassVar[str] = "decrement"
    limits: ClassVar[str] = (
        "The method assumes that the peaks belong to one decaying "
        "oscillation. Other modes in the first peaks bias the delay. "
        "Noise to which the controller responds also biases the delay."
    )

    def names(self, free: Sequence[str], loop: ControlLoop) -> tuple[str, ...]:
        """Delay, and the gain if it is asked for."""
        names = delay_and(free, loop, "decrement")
        if "lag" in names:
            raise ValueError(
                "the decrement method finds delay and gain from two numbers, damping and "
                "frequency, so it cannot fit a lag: fix the lag, or use method='waveform'"
            )
        return names

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        stiffness = steps.stiffness_of(loop, "decrement")
        reading, extremes = steps.read_decaying_step(simulated.recording, "decrement")
        extremes = _linear(extremes, reading, loop)
        lag, sample_time = loop.parameters["lag"], loop.sample_time
        pair, made = native.loop_of_extremes(extremes, lag, sample_time)
        if pair[0] <= 0.0:
            raise NotIdentifiableError(
                "the peaks do not decay: the loop is at or beyond its stability limit, or in "
                "a limit cycle. Use method='relay' or 'waveform'"
            )
        if made is None:
            raise NotIdentifiableError(
                f"no delay gives a sampled loop the root {complex(-pair[0], pair[1]):.3g}: the "
                f"oscillation is too fast for a sample time of {sample_time:g} s"
            )
        found, cov = made[0], np.reshape(made[1], (2, 2))
        delay, gain = float(found[0]), float(found[1]) / loop.parameters["Kp"]
        values = {"delay": delay, "gain": gain}
        scale = np.array([1.0, loop.parameters["Kp"]])
        own = cov / np.outer(scale, scale)
        if "gain" not in names:
            share = cov[0, 1] / cov[1, 1]
            values = {"delay": delay + share * (stiffness - float(found[1]))}
            own = np.array([[cov[0, 0] - share * cov[0, 1]]])
        if values["delay"] <= 0.0:
            raise NotIdentifiableError(
                f"the damping ratio of the peaks is {pair[0] / math.hypot(*pair):.3g}, which "
                f"is more than any delay gives with K = {stiffness:g} 1/s: check the gains"
            )
        return Read(
            values,
            own,
            reading.start,
            message=(
                f"{len(extremes)} extremes, damping ratio {pair[0] / math.hypot(*pair):.3f} at "
                f"{pair[1]:.3f} rad/s{'' if 'gain' in names else ', with the given gain'}"
            ),
            uncalibrated=(
                "the decrement method assumes one decaying oscillation. Noise alone "
                f"gives the delay a standard error of {math.sqrt(own[0, 0]):.2g} s. "
                "Other modes in the first peaks and noise in the command bias the "
                "delay too. Use method='waveform' for an interval"
            ),
            details={
                "damping_ratio": float(pair[0] / math.hypot(*pair)),
                "damped_frequency": float(pair[1]),
                "extremes": [(extreme.time, extreme.height) for extreme in extremes],
                "gain_read": gain,
            },
        )


def _linear(
    extremes: list[steps.Extreme], reading: steps.StepReading, loop: ControlLoop
) -> list[steps.Extreme]:
    """The extremes from the first on at which the command is within its limit."""
    most = math.inf
    if loop.limit is not None:
        most = loop.limit / (abs(loop.parameters["Kp"]) * abs(reading.size))
    linear = [extreme for extreme in extremes if extreme.height <= most]
    if len(linear) >= 2:
        return linear
    if not extremes:
        raise NotIdentifiableError(
            "no overshoot is larger than the noise, and without an oscillation there "
            "are no peaks to read. Raise Kp, or use method='decay' or 'waveform'"
        )
    if len(extremes) >= 2:
        raise NotIdentifiableError(
            f"the command is at its limit of {loop.limit:g} at {len(extremes) - len(linear)} "
            f"of {len(extremes)} extremes, so the decay depends on the limit, not on the "
            "roots. Use a smaller step, or method='waveform'"
        )
    raise NotIdentifiableError(
        f"only one extreme ({100 * extremes[0].height:.2g} % of the step) is larger than the "
        "noise, but a decrement needs two. Raise Kp, record longer, or use method='overshoot'"
    )


#: Crossings at the beginning that are left out: from rest, where noise alone switches the relay,
#: the limit cycle is not yet reached.
LEFT_OUT = 2

#: Fewest half cycles after these: a standard error takes two pairs.
FEWEST_HALF_CYCLES = 4

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
        cycle = native.LimitCycle(data.time, data.output, data.reference, noise, LEFT_OUT)
        crossings, peaks = _checked_cycle(cycle, error)
        switches = _switches(cycle, signs) if loop.is_sampled else crossings[:-1]
        half = float(np.mean(np.diff(crossings)))
        count, mean, stderr = cycle.delays(switches)
        delay = mean - cycle.delay_by_lag(plant.lag, half)
        if delay <= 0.0:
            raise NotIdentifiableError(
                f"lag and hold explain a quarter of the period, {0.5 * half:.3g} s. "
                f"So the lag is shorter than {plant.lag:g} s, or there is no delay"
            )
        found = cycle.path(switches, delay, plant.lag)
        assert found is not None  # there are rows between the first and the last crossing
        ends, path, output, fitted = found
        first, last = data.time[ends].tolist()
        slope = abs(plant.gain) * height if height is not None else abs(fitted)
        waits = float(np.mean(switches - crossings[:-1]))
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


def _checked_cycle(cycle: native.LimitCycle, error: Array) -> tuple[Array, Array]:
    """Crossings and peaks of a cycle; refuses what is no sustained oscillation."""
    crossings = cycle.crossings
    if float(np.ptp(error)) == 0.0:
        raise NotIdentifiableError("the output does not move, so there is no limit cycle")
    if crossings.size < FEWEST_HALF_CYCLES + 1:
        raise NotIdentifiableError(
            f"after the first {LEFT_OUT} crossings, the output crosses the "
            f"reference {crossings.size} times, but {FEWEST_HALF_CYCLES + 1} times are "
            "needed. Either there is no limit cycle, or the window is too short"
        )
    halves = np.diff(crossings)
    if float(np.std(halves)) > UNEVEN * float(np.mean(halves)):
        raise NotIdentifiableError(
            "the time between crossings of the reference varies from "
            f"{float(halves.min()):.3g} to {float(halves.max()):.3g} s. "
            "So this is noise or a changing reference, not a limit cycle"
        )
    peaks = cycle.peaks
    if peaks[-1] < SHRINKING * peaks[0]:
        raise NotIdentifiableError(
            f"the oscillation decays from {peaks[0]:.3g} to {peaks[-1]:.3g}, so no "
            "relay sustains this oscillation. Use method='decrement' or 'waveform'"
        )
    return crossings, peaks


def _switches(cycle: native.LimitCycle, signs: Array) -> Array:
    """Time of the switch at each crossing but the last."""
    counts, times = cycle.switches(signs)
    for count, crossing in zip(counts, cycle.crossings, strict=False):
        if count % 2 == 0:
            raise NotIdentifiableError(
                f"the command switches {count} times around the crossing at "
                f"{crossing:.3g} s. Either noise hides the limit cycle, or "
                "the command does not come from a relay. Use a larger relay"
            )
    return np.array(times)
