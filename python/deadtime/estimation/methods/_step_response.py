"""Delay of an integrator under proportional control, from parts of a step response.

`Overshoot`: the loop is ``z'(t) = K (r − z)(t − Td)`` with ``K = gain·Kp``; everything depends on
``x = K·Td`` alone. Three maps from the overshoot Mo to x:

* ``dominant``: Armah & Yi's. Mo gives a damping ratio ζ as in a second-order system (their
  eq. 5), and the rightmost root ``s = W₀(−K Td)/Td`` (eq. 3) has ``ζ = |Re s|/|s|`` (eq. 6). The
  step response is approximated by that of one pair of roots, which makes the delay 0 to 4 % too
  long.
* ``exact``: the step response itself. With θ = t/Td the error ``e = 1 − z`` is the delayed
  exponential ``e(θ) = Σ_j (−x)^j (θ − j + 1)^j / j!`` over ``j ≤ θ + 1`` (method of steps); z
  peaks one delay after the first zero of e.
* ``saturated``: the loop with its hold and its limit, simulated at the time stamps of the
  recording; no closed form.

All maps assume the given gain and no lag, and none corrects for the largest of many noisy samples
being larger than the peak.

`Graphical`: construction of the delay from the beginning of one step response.

An integrator under P control does not move for Td after a step. For another Td it rises along a
straight line, because the commands that arrive were computed before it moved:

* ``tangent``: the line through that straight part, from Td to 2 Td (in a sampled loop to Td after
  the first sample that can see a movement), meets the initial output at Td. The straight part is
  found by iteration.
* ``two_point``: the line through the times at which two shares of the step are reached.
* ``first_movement``: the first sample from which on the output stays above the noise; later than
  the delay by the time this takes, and by up to a sample.

A limit and a hold do not bend the line. A lag does: part of it counts as delay. Shares beyond K Td
(or beyond limit Td over the step) are no longer on the line. Only the few samples on the line are
used, and there is no interval.

`Decay`: the exponential tail of a step response that does not overshoot.

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
from typing import ClassVar, Literal, get_args

import numpy as np

import deadtime.estimation._native as native
import deadtime.estimation.data._step_reading as steps
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import positive
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.methods._method import OfOne, Read, Run, check_choice
from deadtime.loops import ControlLoop

OvershootMap = Literal["dominant", "exact", "saturated"]


def damping_ratio(overshoot: float) -> float:
    """Damping ratio of a second-order system with this overshoot (Armah & Yi eq. 5).

    ``ζ = −ln Mo / √(π² + ln² Mo)``.

    Parameters
    ----------
    overshoot : float
        Mo as a fraction, between 0 and 1 (both excluded).

    Returns
    -------
    float

    Raises
    ------
    NotIdentifiableError
        When the equation has no solution: Mo ≤ 0 or Mo ≥ 1.

    Examples
    --------
    >>> from deadtime import damping_ratio
    >>> round(damping_ratio(0.0230), 4)
    0.7684
    """
    if not 0.0 < overshoot < 1.0:
        raise NotIdentifiableError(
            f"an overshoot of {100 * overshoot:.4g} % has no damping "
            "ratio, because equation (5) is valid only from 0 to 100 %. "
            "Use map='exact' above 100 %, or the waveform method below 0 %"
        )
    log = math.log(overshoot)
    return -log / math.hypot(math.pi, log)


def dominant_x(overshoot: float) -> float:
    """``x = K·Td`` of the loop whose rightmost root has the damping ratio of `overshoot`.

    With ζ = cos φ the root is ``Td·s = −ρ e^(∓iφ)``; ``w e^w = −x`` then says
    ``ρ sin φ = φ`` and ``x = ρ e^(−ρ cos φ)``: eqs. 3 and 6 solved without iteration.
    """
    phi = math.acos(damping_ratio(overshoot))
    rho = phi / math.sin(phi)
    return rho * math.exp(-rho * math.cos(phi))


def exact_x(overshoot: float) -> float:
    """``x = K·Td`` of the exact step response with this overshoot, which increases with x."""
    x = native.x_of_overshoot(overshoot)
    if x is None:
        raise NotIdentifiableError(
            f"at an overshoot of {100 * overshoot:.3g} %, K·Td is at its limit 1/e = "
            f"{math.exp(-1.0):.4f}, so the overshoot is too small. Use the waveform method"
        )
    return x


@dataclass(frozen=True)
class Overshoot(OfOne):
    """Delay from the overshoot of one step, as Armah & Yi read it.

    Parameters
    ----------
    map : {"dominant", "exact", "saturated"}
        From the overshoot to the delay: by the rightmost pair of roots alone (the paper's), by
        the exact step response, or by simulating the loop with its hold and limit.

    Raises
    ------
    ValueError
        For another map.
    """

    map: OvershootMap = "dominant"

    name: ClassVar[str] = "overshoot"
    limits: ClassVar[str] = (
        "The method reads one peak, and assumes that the gain is known. A vehicle "
        "with a smaller gain overshoots less, so its estimated delay is too short."
    )

    def __post_init__(self) -> None:
        check_choice("map", self.map, get_args(OvershootMap))

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        stiffness = steps.stiffness_of(loop, "overshoot")
        reading = steps.read_step(simulated.recording)
        if self.map != "saturated":  # which simulates the limit
            steps.check_decays(steps.read_extremes(reading), "overshoot")
        overshoot, noise = _overshoot(reading)

        def delay_of(value: float) -> float:
            if self.map == "dominant":
                return dominant_x(value) / stiffness
            if self.map == "exact":
                return exact_x(value) / stiffness
            return _saturated_delay(value, reading, simulated, exact_x(value) / stiffness)

        delay = delay_of(overshoot)
        # A difference quotient with the noise as its step: the map is smooth and the noise small.
        change = max(noise, 1e-6)
        slope = (
            abs(delay_of(overshoot + change) - delay) / change if overshoot + change < 1 else 0.0
        )
        stderr = slope * noise
        details = {"map": self.map, "overshoot": overshoot, "overshoot_noise": noise}
        if 0.0 < overshoot < 1.0:
            details["damping_ratio"] = damping_ratio(overshoot)
        return Read(
            {"delay": delay},
            stderr,
            reading.start,
            message=(
                f"{100 * overshoot:.2f} % overshoot, map {self.map!r}, "
                f"assuming a gain of {loop.parameters['gain']:g} and no lag"
            ),
            uncalibrated=(
                "the overshoot method reads one peak. Noise alone gives the delay "
                f"a standard error of {stderr:.2g} s. With noise, the largest "
                "sample is too high on average. A wrong gain, a lag or the hold "
                "also bias the delay. Use method='waveform' for an interval"
            ),
            details=details,
        )


def _overshoot(reading: steps.StepReading) -> tuple[float, float]:
    """The overshoot of a step response as a share of the step, and its standard deviation.

    Refuses a response without overshoot.
    """
    value = float(np.max(reading.travelled)) - 1.0
    settled = max(0.0, float(np.mean(reading.tail)) - 1.0)
    if value - settled <= max(steps.CLEARANCE * reading.noise, 1e-9):
        beyond = max(0.0, value - settled)
        raise NotIdentifiableError(
            "there is no overshoot: the output exceeds its final value by "
            f"{100 * beyond:.2g} % of the step, and noise alone by "
            f"{100 * steps.CLEARANCE * reading.noise:.2g} %. Kp·Td is below or near 1/e, where "
            "the overshoot does not determine the delay. Raise Kp, or use method='waveform'"
        )
    return value, reading.noise * math.sqrt(1.0 + 1.0 / reading.start_samples)


def _saturated_delay(
    overshoot: float, reading: steps.StepReading, simulated: SimulatedRecording, start: float
) -> float:
    """Delay at which the simulated loop overshoots by this much at the recorded times."""
    from scipy.optimize import brentq

    def excess(delay: float) -> float:
        output = simulated.output({"delay": delay}, reading.start)
        share = (output[reading.step.index :] - reading.start) / reading.size
        return float(np.max(share)) - 1.0 - overshoot

    low, high = 0.5 * start, 1.5 * start
    for _ in range(40):
        if excess(low) <= 0.0:
            break
        low *= 0.7
    else:
        raise NotIdentifiableError(
            "because of its hold, the loop would overshoot by "
            f"more than {100 * overshoot:.3g} % even without a "
            "delay: check the gains and the sample time"
        )
    span = float(simulated.recording.time[-1] - reading.step.time)
    while excess(high) < 0.0:
        high *= 1.3
        if high > span:
            raise NotIdentifiableError(
                f"with this limit of the command, no delay up to {span:g} s gives an "
                f"overshoot of {100 * overshoot:.3g} %: check the limit and the gains"
            )
    return float(brentq(excess, low, high, xtol=1e-12, rtol=1e-12))


Construction = Literal["tangent", "two_point", "first_movement"]

#: Movements below this share of the step, and delays below this share of the response, count as
#: rounding.
LEAST = 1e-9


@dataclass(frozen=True)
class Graphical(OfOne):
    """Delay from the beginning of one step response, by a construction with straight lines.

    Parameters
    ----------
    construction : {"tangent", "two_point", "first_movement"}
        The line through the straight part of the rise, the line through two points of it, or the
        first sample that stands out of the noise.
    shares : (float, float)
        Shares of the step that the two points of ``"two_point"`` have reached, increasing.

    Raises
    ------
    ValueError
        For another construction, or shares that do not increase between 0 and 1.
    """

    construction: Construction = "tangent"
    shares: tuple[float, float] = (0.1, 0.35)

    name: ClassVar[str] = "graphical"
    limits: ClassVar[str] = (
        "The method reads the few samples on the first straight part of the step, and counts "
        "part of a lag as delay."
    )

    def __post_init__(self) -> None:
        check_choice("construction", self.construction, get_args(Construction))
        low, high = self.shares
        if not 0.0 < low < high < 1.0:
            raise ValueError(f"shares={self.shares}: give two increasing numbers between 0 and 1")

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        reading, _ = steps.read_decaying_step(simulated.recording, "graphical")
        moved = _first_movement(reading)
        delay, stderr = float(reading.since[moved]), math.nan
        if self.construction != "first_movement":
            steps.stiffness_of(loop, "graphical")
        if self.construction == "two_point":
            delay = _two_point(reading, *self.shares)
        elif self.construction == "tangent":
            delay, stderr = _tangent(reading, moved, loop.sample_time)
        if not delay > LEAST * float(reading.since[-1]):
            raise NotIdentifiableError(
                f"the line meets the initial output {-delay:.3g} s before the step. Either its "
                "samples are too few or too noisy, or there is no delay. Use method='waveform'"
            )
        return Read(
            {"delay": delay},
            stderr,
            reading.start,
            message=(
                f"{self.construction.replace('_', ' ')} of one step: part of a lag counts as delay"
            ),
            uncalibrated=(
                "the graphical method uses the first samples that move. Its error from a lag "
                "or from its thresholds is not known. Use method='waveform' for an interval"
            ),
            details={
                "construction": self.construction,
                "first_movement": float(reading.since[moved]),
                "noise": reading.noise,
            },
        )


def _first_movement(reading: steps.StepReading) -> int:
    """Row of the first sample from which on the output stays above the noise."""
    moved = native.first_movement(reading.travelled, max(steps.CLEARANCE * reading.noise, LEAST))
    if moved is None:
        raise NotIdentifiableError(
            f"the output moves within the first sample after the step at {reading.step.time:g} "
            "s, or not at all, so no delay can be read. Use method='waveform'"
        )
    return moved


def _two_point(reading: steps.StepReading, low: float, high: float) -> float:
    """Time after the step, s, at which the line through two shares meets the initial output."""
    if low < steps.CLEARANCE * reading.noise:
        raise NotIdentifiableError(
            f"the smaller of `shares`, {low:g}, is too close to the noise, which is "
            f"{reading.noise:.2g} of the step. Give larger `shares`, or a larger step"
        )
    return native.line_through(reading.since, reading.travelled, (low, high))


def _tangent(reading: steps.StepReading, moved: int, held: float | None) -> tuple[float, float]:
    """Time after the step, s, at which the straight part meets the initial output; its error."""
    # Between the last sample that had not moved and the first that had.
    delay = 0.5 * float(reading.since[moved - 1] + reading.since[moved])
    found, few = native.rise_tangent(reading.since, reading.travelled, delay, held, reading.noise)
    if few is not None:
        count, begin, until = few
        raise NotIdentifiableError(
            f"the straight part, from {begin:.3g} to {until:.3g} s after the step, has only "
            f"{count} samples: sample faster than twice a delay, or use method='waveform'"
        )
    if found is None:
        raise NotIdentifiableError(
            "the output falls during the part of the response that should be a rising line, "
            "so noise hides this part. Use method='waveform'"
        )
    return found


#: Fewest samples of a tail.
FEWEST_OF_TAIL = 5


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
        delay, slope = native.delay_of_rate(rate, stiffness, lag, loop.sample_time)
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
    count, tail = native.step_tail(
        reading.since, reading.travelled, share, most, clear, FEWEST_OF_TAIL
    )
    if tail is None:
        raise NotIdentifiableError(
            f"the tail has {count} samples, but the method needs {FEWEST_OF_TAIL}: sample "
            "faster, record longer, or begin the tail earlier with a larger `tail`"
        )
    height, rate, error = tail
    if height <= 0.0 or rate <= 0.0 or rate < steps.CLEARANCE * error:
        raise NotIdentifiableError(
            f"the tail decays at {rate:.3g} ± {error:.2g} 1/s, so the rate may be zero. "
            "Begin the tail earlier with a larger `tail`, or use method='waveform'"
        )
    return rate, error, count
