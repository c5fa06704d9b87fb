"""Delay from the exponential tail of a step response that does not overshoot.

With K Td < 1/e the rightmost root of s (lag s + 1) + K e^(-s Td) = 0 is real, s = -r, and the
control error decays as e^(-r t). The rate r is fitted to the tail by least squares; then

    Td = ln(r (1 - lag r)/K)/r                    continuous,
    K = -1/H(e^(-r h); Td)                        sampled every h, H the held plant,

so the gain has to be known: an error of one per cent in it has about the effect of one in 1/r. The
mode of the next root, also real, decays faster, but near K Td = 1/e hardly so: a later tail
contains less of it, and less signal. The standard error is that of r by the delta method. The
method assumes the gain, an output that ends at the reference, and no disturbance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import deadtime.estimation.data._step_reading as steps
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import positive
from deadtime.estimation._native import delay_of_rate, step_tail
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
