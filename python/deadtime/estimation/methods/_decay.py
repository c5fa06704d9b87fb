"""Delay from the decay of a step response: of its tail, or of its peaks.

`Decay`: the exponential tail of a step response that does not overshoot.

With K Td < 1/e the rightmost root of s (lag s + 1) + K e^(-s Td) = 0 is real, s = -r, and the
control error decays as e^(-r t). The rate r is fitted to the tail by least squares; then

    Td = ln(r (1 - lag r)/K)/r                    continuous,
    K = -1/H(e^(-r h); Td)                        sampled every h, H the held plant,

so the gain has to be known: an error of one per cent in it has about the effect of one in 1/r. The
mode of the next root, also real, decays faster, but near K Td = 1/e hardly so: a later tail
contains less of it, and less signal. The standard error is that of r by the delta method. The
method assumes the gain, an output that ends at the reference, and no disturbance.

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
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import deadtime.estimation.data._step_reading as steps
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import positive
from deadtime.estimation._native import delay_of_rate, loop_of_extremes, step_tail
from deadtime.estimation.data._checks import delay_and
from deadtime.estimation.methods._method import OfOne, Read, Run
from deadtime.loops import ControlLoop

#: Fewest samples of a tail.
FEWEST = 5


@dataclass(frozen=True)
class Decay(OfOne):
    """Delay from the exponential tail of a step response that does not overshoot.

    Parameters
    ----------
    tail : float
        The tail begins where this share of the step is left; between 0 and 1.

    Raises
    ------
    ValueError
        When the share is not between 0 and 1.
    """

    tail: float = 0.3

    name: ClassVar[str] = "decay"
    limits: ClassVar[str] = (
        "The method assumes that the gain is known and that the tail is one "
        "exponential. So a wrong gain, a lag or other modes bias the delay."
    )

    def __post_init__(self) -> None:
        if positive("tail", self.tail) >= 1.0:
            raise ValueError(
                f"tail={self.tail}: give the share of the step "
                "that remains where the tail begins, below 1"
            )

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        stiffness = steps.stiffness_of(loop, "decay")
        reading, extremes = steps.read_decaying_step(simulated.recording, "decay")
        if extremes:
            raise NotIdentifiableError(
                "the output overshoots, so the rightmost roots are complex, and the tail "
                "is not an exponential. Use method='decrement', 'overshoot' or 'waveform'"
            )
        rate, error, samples = _rate(reading, loop, self.tail)
        lag = loop.parameters["lag"]

        if lag * rate >= 1.0:
            raise NotIdentifiableError(
                f"the tail decays at {rate:.4g} 1/s, faster than is possible with "
                f"a lag of {lag:g} s. So the true lag is smaller: check the lag"
            )
        delay, slope = delay_of_rate(rate, stiffness, lag, loop.sample_time)
        stderr = abs(slope) * error
        if delay < 0.0:
            raise NotIdentifiableError(
                f"the tail decays at {rate:.4g} 1/s, slower than without any "
                f"delay at K = {stiffness:.4g} 1/s. Either the gain is smaller "
                "than given, or the tail begins too late. Check the gains"
            )
        held = 0.5 * (loop.sample_time or 0.0)
        if rate * (delay + lag + held) >= 1.0:
            raise NotIdentifiableError(
                f"the tail decays at {rate:.4g} 1/s, but without overshoot at "
                f"most e·K = {math.e * stiffness:.4g} 1/s is possible. So K·Td "
                "is near or above 1/e. Use method='decrement' or 'waveform'"
            )
        return Read(
            {"delay": delay},
            stderr,
            reading.start,
            message=(
                f"{samples} samples of the tail decay at {rate:.4g} ± {error:.2g} 1/s, assuming "
                f"a gain of {loop.parameters['gain']:g} and an output that ends at the reference"
            ),
            uncalibrated=(
                "the decay method assumes the given gain and an exponential tail. Noise "
                f"alone gives the delay a standard error of {stderr:.2g} s. A gain error "
                f"of 1 % shifts the delay by {0.01 / rate:.2g} s, and other modes in the "
                "tail also shift the delay. Use method='waveform' for an interval"
            ),
            details={"rate": rate, "rate_error": error, "tail_samples": samples},
        )


def _rate(reading: steps.StepReading, loop: ControlLoop, share: float) -> tuple[float, float, int]:
    """Rate of the tail, where no command was limited, its standard error and number of samples."""
    most = math.inf
    if loop.limit is not None:
        most = loop.limit / (loop.parameters["Kp"] * abs(reading.size))
    clear = steps.CLEARANCE * reading.noise
    count, tail = step_tail(reading.since, reading.travelled, share, most, clear, FEWEST)
    if tail is None:
        raise NotIdentifiableError(
            f"the tail has {count} samples, but the method needs {FEWEST}: sample "
            "faster, record longer, or begin the tail earlier with a larger `tail`"
        )
    height, rate, error = tail
    if height <= 0.0 or rate <= 0.0 or rate < steps.CLEARANCE * error:
        raise NotIdentifiableError(
            f"the tail decays at {rate:.3g} ± {error:.2g} 1/s, so the rate may be zero. "
            "Begin the tail earlier with a larger `tail`, or use method='waveform'"
        )
    return rate, error, count


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
        pair, made = loop_of_extremes(extremes, lag, sample_time)
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
