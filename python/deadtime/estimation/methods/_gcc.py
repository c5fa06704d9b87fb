"""Generalised cross-correlation of the command and the response of the vehicle.

The response r is the command u, delayed, plus noise, so their correlation over the shift,
R(m) = sum_k u_k r_{k+m}, peaks at the delay. Knapp & Carter (1976) filter both first: their cross
spectrum is weighted by 1 ("none"), 1/sqrt(S_uu S_rr) ("scot"), 1/abs(S_ur) ("phat"), or both
signals pass the filter that whitens u ("prewhitened": Box & Jenkins 1970, section 11.1.2; its order
by Akaike's criterion). The peak is found between samples: for a broad one by a parabola; for
whitened ones by the share of the two largest values, which a delay of (d + f) samples under a hold
leaves at 1 - f and f.

In a closed loop the command depends on the output and its noise, and is correlated with it at
negative shifts too: the peak is biased, more so with weaker excitation. Whether the command follows
the output is tested and reported. A step excites few frequencies: weightings that treat all alike
then amplify noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.data._input_output import (
    FEEDBACK,
    InputOutput,
    feedback_p_value,
    read_input_output,
)
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.estimation.data._step_reading import check_decays, read_ringing
from deadtime.estimation.methods._conclusion import check_delay_alone, read_off_estimate
from deadtime.estimation.methods._method import Method, Run, check_choice

Weighting = Literal["none", "scot", "phat", "prewhitened"]

#: Significance level of the correlation at one shift. Uncorrelated signals exceed it at the best of
#: a hundred shifts in one of a hundred recordings.
LEVEL = 1e-4

#: Width of the average of spectra for "scot", as a share of all frequencies: a wider one has less
#: noise and less resolution.
SMOOTHED = 0.05

#: Longest whitening filter, in samples.
LONGEST_FILTER = 12


@dataclass(frozen=True)
class GCC(Method):
    """Delay at the peak of the generalised cross-correlation of command and response.

    Parameters
    ----------
    weighting : {"none", "scot", "phat", "prewhitened"}
        Weighting of the cross spectrum.

    Raises
    ------
    ValueError
        For another weighting.
    """

    weighting: Weighting = "none"

    name: ClassVar[str] = "gcc"
    limits: ClassVar[str] = (
        "Under feedback the command contains the noise of the output, which moves the peak of the "
        "correlation, the more the weaker the excitation."
    )

    def __post_init__(self) -> None:
        check_choice("weighting", self.weighting, get_args(Weighting))

    def estimate(self, runs: Sequence[Run], free: Sequence[str]) -> DelayEstimate:
        """Fit `free` to the one recording."""
        ((recording, loop, window, *_),) = runs
        check_delay_alone("gcc", free)
        simulated = SimulatedRecording(recording, loop, window)
        data = simulated.recording
        read = read_input_output(simulated, "gcc")
        if int(np.count_nonzero(np.diff(read.command))) < 2:
            raise NotIdentifiableError(
                "the command changes at most once in the window, as when it is at its limit: its "
                "correlation has no peak; use a smaller step, or method='output_error'"
            )
        p_value = feedback_p_value(data)
        feedback = p_value < FEEDBACK
        if feedback:
            check_decays(read_ringing(data), "gcc")
        # Feedback within the same sample makes a peak at shift zero.
        least = 1 if feedback else 0
        gain = float(loop.parameters.get("gain", 1.0))
        shifts, correlation = correlogram(
            read.command, np.sign(gain) * read.response, self.weighting
        )
        near = (shifts >= least - 1) & (shifts <= read.longest + 1)
        shifts, correlation = shifts[near], correlation[near]
        place = int(np.argmax(correlation[1:-1])) + 1
        share = _explained(read, int(shifts[place]))
        peak = float(shifts[place]) + _between(correlation, place, self.weighting)
        delay = max(0.0, peak * read.sample_time - read.late)
        return read_off_estimate(
            "gcc",
            simulated,
            {"delay": delay},
            None,
            float(data.output[0]),
            message=_message(self.weighting, share, feedback, read),
            uncalibrated=(
                "the gcc method reads the peak of a correlation: the error formulas for it hold "
                "for stationary noise in open loop only"
                + (", and here the command depends on the output" if feedback else "")
                + "; use method='output_error' for an interval"
            ),
            details={
                "weighting": self.weighting,
                "correlation": share,
                "feedback": feedback,
                "feedback_p_value": p_value,
            },
        )


def correlogram(u: Array, r: Array, weighting: Weighting) -> tuple[Array, Array]:
    """Shifts in samples and the generalised cross-correlation of u and r at them."""
    from scipy import signal

    if weighting == "prewhitened":
        whitener = _whitener(u)
        u, r = np.convolve(u, whitener)[: u.size], np.convolve(r, whitener)[: r.size]
    if weighting in ("none", "prewhitened"):
        return (
            np.asarray(signal.correlation_lags(r.size, u.size), dtype=np.float64),
            np.asarray(signal.correlate(r, u)),
        )
    length = 2 * u.size  # long enough that no shift wraps around
    spectrum_u, spectrum_r = np.fft.rfft(u, length), np.fft.rfft(r, length)
    cross = spectrum_r * np.conj(spectrum_u)
    if weighting == "phat":
        scale = np.abs(cross)
    else:
        width = max(3, int(SMOOTHED * spectrum_u.size))
        window = np.ones(width) / width
        power = [np.convolve(np.abs(x) ** 2, window, "same") for x in (spectrum_u, spectrum_r)]
        scale = np.sqrt(power[0] * power[1])
    found = np.fft.irfft(cross / np.maximum(scale, 1e-12 * scale.max()), length)
    shifts = np.arange(-u.size, u.size, dtype=np.float64)
    return shifts, np.roll(found, u.size)


def _whitener(u: Array) -> Array:
    """The whitening filter 1 - a_1 q - a_2 q² … of u, its order by Akaike's criterion."""
    most = min(LONGEST_FILTER, u.size // 8)
    target = u[most:]
    past = np.stack([u[most - lag : u.size - lag] for lag in range(1, most + 1)], axis=1)
    best, chosen = np.inf, np.ones(1)
    for order in range(most + 1):
        weights = np.linalg.lstsq(past[:, :order], target, rcond=None)[0]
        power = float(np.sum((target - past[:, :order] @ weights) ** 2))
        criterion = target.size * np.log(max(power, 1e-24 * float(u @ u))) + 2 * order
        if criterion < best:
            best, chosen = criterion, np.concatenate([[1.0], -weights])
    return chosen


def _between(correlation: Array, place: int, weighting: Weighting) -> float:
    """Position of the peak relative to the largest value, in samples."""
    before, top, after = (float(value) for value in correlation[place - 1 : place + 2])
    if weighting in ("none", "scot"):
        bend = before - 2.0 * top + after
        return float(np.clip(0.5 * (before - after) / bend, -1.0, 1.0)) if bend < 0.0 else 0.0
    beside, sign = (after, 1.0) if after > before else (before, -1.0)
    return sign * max(beside, 0.0) / (top + max(beside, 0.0))


def _explained(read: InputOutput, shift: int) -> float:
    """Correlation coefficient of response and shifted command; refuses insignificant ones."""
    from scipy import signal, special

    late = max(0, shift)
    size = read.command.size
    u, r = read.command[: size - late], read.response[late:]
    coefficient = float(u @ r) / float(np.linalg.norm(u) * np.linalg.norm(r) or 1.0)
    # For independent signals its variance is sum_m rho_u(m) rho_e(m)/n (Bartlett 1935).
    left = r - u * float(u @ r) / float(u @ u or 1.0)
    rho = [np.asarray(signal.correlate(x, x))[u.size - 1 :] for x in (u, left)]
    rho_u, rho_e = (x / x[0] if x[0] > 0.0 else x for x in rho)
    taper = 1.0 - np.arange(u.size) / u.size
    spread = 1.0 + 2.0 * float(np.sum((taper * rho_u * rho_e)[1 : u.size // 4]))
    needed = -float(special.ndtri(LEVEL)) * np.sqrt(max(spread, 0.25) / u.size)
    if abs(coefficient) < needed:
        raise NotIdentifiableError(
            f"command and response are correlated by {abs(coefficient):.2g} at best, unrelated "
            f"signals by up to {needed:.2g}: the output is no response to this command, or the "
            "noise hides it; check columns and units, or excite more"
        )
    return abs(coefficient)


def _message(weighting: Weighting, share: float, feedback: bool, read: InputOutput) -> str:
    text = (
        f"peak of the cross-correlation (weighting {weighting!r}), command and response correlated "
        f"by {share:.2f}"
    )
    if feedback:
        text += (
            "; the command depends on the output, so noise is on both and biases the peak: use it "
            "as an initial value only"
        )
    return text + read.remark
