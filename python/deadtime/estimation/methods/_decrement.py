"""Logarithmic decrement: delay and gain from successive peaks and valleys of a step response.

Once the other modes have decayed, the step response oscillates as e^(-σt) cos(ω_d t + φ) with the
rightmost pair s = -σ ± iω_d. Its extremes follow each other after π/ω_d, each e^(-σπ/ω_d) times
the one before (Armah & Yi's eq. 4): a line through the logarithms of their heights and one through
their times give σ and ω_d. The pair is a root of s (lag s + 1) + K e^(-s Td) = 0, two real
equations: with cos φ = σ/abs(s) and no lag, Td = φ/ω_d and K = ω_d e^(-σ Td)/sin φ, whatever the
gain. In a sampled loop 1 + K H(e^(s h); Td) = 0, H the held plant, takes its place. A known
gain is used by conditioning: with the covariance C of (Td, K), Td moves by C_TK/C_KK (K_known - K).

Only peaks at which the command is within its limit are used. The other modes contribute some per
cent to the first of them, and less to each that follows.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._checks import check_delay_free, checked_names
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.data._step_reading import (
    Extreme,
    StepReading,
    read_decaying_step,
    stiffness_of,
    weighted_slope,
)
from deadtime.estimation.methods._conclusion import read_off_estimate
from deadtime.estimation.methods._method import Method, Run
from deadtime.estimation.models._held import held_transfer
from deadtime.loops import ControlLoop

#: Contribution of the other modes to the first extreme as a share, and the factor by which it falls
#: to the next one. With K Td between 0.5 and 1.5 the second pair of roots decays 30 to 100 times as
#: much per half period as the first.
OTHER_MODES = 0.03


@dataclass(frozen=True)
class Decrement(Method):
    """Delay, and gain if it is free, from the decay of successive peaks and valleys."""

    name: ClassVar[str] = "decrement"
    limits: ClassVar[str] = (
        "It takes the peaks as those of one decaying oscillation, so that other modes in the first "
        "peaks, and noise on which the controller acts, move the delay."
    )

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        ((recording, loop, window, *_),) = runs
        names = checked_names(free, loop)
        if "lag" in names:
            raise ValueError(
                "the decrement method has two numbers, damping and frequency, for delay and gain: "
                "fix the lag, or use method='waveform'"
            )
        check_delay_free(names, "decrement")
        stiffness = stiffness_of(loop, "decrement")
        simulated = SimulatedRecording(recording, loop, window)
        reading, extremes = read_decaying_step(simulated.recording, "decrement")
        extremes = _linear(extremes, reading, loop)
        pair, pair_cov = _ringing(extremes)
        lag = loop.parameters["lag"]

        def numbers(sigma: float, omega: float) -> Array:
            return np.array(loop_with_root(complex(-sigma, omega), lag, loop.sample_time))

        found = numbers(*pair)
        slopes = np.stack(
            [
                (numbers(*(pair + change)) - numbers(*(pair - change))) / (2.0 * change.sum())
                for change in np.diag(1e-6 * pair[1] * np.ones(2))
            ],
            axis=1,
        )
        cov = slopes @ pair_cov @ slopes.T
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
                f"the peaks decay with a damping ratio of {pair[0] / math.hypot(*pair):.3g}, "
                f"more than any delay gives with K = {stiffness:g} 1/s: check the gains"
            )
        return read_off_estimate(
            "decrement",
            simulated,
            values,
            own,
            reading.start,
            message=_message(extremes, names, pair),
            uncalibrated=(
                "the decrement method assumes one decaying oscillation: noise alone makes the "
                f"delay uncertain by {math.sqrt(own[0, 0]):.2g} s, but other modes in the first "
                "peaks, and noise that the controller acts on, shift it further; use "
                "method='waveform' for an interval"
            ),
            details={
                "damping_ratio": float(pair[0] / math.hypot(*pair)),
                "damped_frequency": float(pair[1]),
                "extremes": [(extreme.time, extreme.height) for extreme in extremes],
                "gain_read": gain,
            },
        )


def loop_with_root(root: complex, lag: float, sample_time: float | None) -> tuple[float, float]:
    """Delay and K of the integrator loop that has this root, of the smallest delay there is.

    The phase of the plant at the root falls as the delay grows, so there is one delay for every
    turn; the rightmost root belongs to the first.
    """
    from scipy.optimize import brentq

    plant = root * (lag * root + 1.0)
    # e^(-s Td) = -s (lag s + 1)/K
    delay = -cmath.phase(-plant) / root.imag
    if sample_time is None:
        return delay, abs(plant) * math.exp(root.real * delay)
    z = cmath.exp(root * sample_time)
    h = sample_time

    def gain_at(late: float) -> complex:
        return -1.0 / held_transfer(z, late, lag, h)

    def phase(late: float) -> float:
        # relative to the required phase, so that no jump of 2π is within half a period of it
        return cmath.phase(gain_at(late))

    # The hold delays by about half a sample.
    reach = min(h, 0.4 * math.pi / root.imag)
    low, high = delay - 0.5 * h - reach, delay - 0.5 * h + reach
    if not phase(low) < 0.0 < phase(high):
        raise NotIdentifiableError(
            f"no delay gives a sampled loop the root {root:.3g}: the oscillation is too fast for "
            f"a sample time of {h:g} s"
        )
    delay = float(brentq(phase, low, high, xtol=1e-15))
    return delay, gain_at(delay).real


def _linear(extremes: list[Extreme], reading: StepReading, loop: ControlLoop) -> list[Extreme]:
    """The extremes from the first on at which the command is within its limit."""
    most = math.inf
    if loop.limit is not None:
        most = loop.limit / (abs(loop.parameters["Kp"]) * abs(reading.size))
    linear = [extreme for extreme in extremes if extreme.height <= most]
    if len(linear) >= 2:
        return linear
    if not extremes:
        raise NotIdentifiableError(
            "no overshoot above the noise: without an oscillation, peaks do not determine the "
            "delay; raise Kp, or use method='decay' or 'waveform'"
        )
    if len(extremes) >= 2:
        raise NotIdentifiableError(
            f"the command is at its limit of {loop.limit:g} at {len(extremes) - len(linear)} of "
            f"{len(extremes)} extremes: the limit, not the roots, determines their decay; use a "
            "smaller step, or method='waveform'"
        )
    raise NotIdentifiableError(
        f"one extreme ({100 * extremes[0].height:.2g} % of the step) is above the noise, and "
        "a decrement takes two: raise Kp, record longer, or use method='overshoot'"
    )


def _ringing(extremes: list[Extreme]) -> tuple[Array, Array]:
    """Decay rate and damped frequency of the extremes, and their covariance."""
    count = len(extremes)
    index = np.arange(count, dtype=np.float64)
    height = np.array([extreme.height for extreme in extremes])
    time = np.array([extreme.time for extreme in extremes])
    contribution = OTHER_MODES ** (index + 1.0)
    half, half_error = weighted_slope(
        index, time, np.hypot([e.time_error for e in extremes], contribution * np.diff(time).mean())
    )
    fall, fall_error = weighted_slope(
        index, np.log(height), np.hypot([e.height_error for e in extremes] / height, contribution)
    )
    omega = math.pi / half
    sigma = -fall / half
    if sigma <= 0.0:
        raise NotIdentifiableError(
            "the peaks do not decay: the loop is at or beyond its stability limit, or in a "
            "limit cycle; use method='relay' or 'waveform'"
        )
    slopes = np.array([[-1.0 / half, -sigma / half], [0.0, -omega / half]])
    cov = slopes @ np.diag([fall_error**2, half_error**2]) @ slopes.T
    return np.array([sigma, omega]), cov


def _message(extremes: list[Extreme], names: tuple[str, ...], pair: Array) -> str:
    known = "" if "gain" in names else ", with the given gain"
    return (
        f"{len(extremes)} extremes, damping ratio {pair[0] / math.hypot(*pair):.3f} at "
        f"{pair[1]:.3f} rad/s{known}"
    )
