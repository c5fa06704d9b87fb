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

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import correlation_coefficient, correlation_peak
from deadtime.estimation.data._input_output import InputOutput, first_shift, read_input_output
from deadtime.estimation.methods._method import OfOne, Read, Run, check_choice

Weighting = Literal["none", "scot", "phat", "prewhitened"]

#: Significance level of the correlation at one shift. Uncorrelated signals exceed it at the best of
#: a hundred shifts in one of a hundred recordings.
LEVEL = 1e-4


@dataclass(frozen=True)
class GCC(OfOne):
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
        "Under feedback the command contains the noise of the output, which shifts the peak "
        "of the correlation. This error grows as the excitation becomes weaker."
    )

    def __post_init__(self) -> None:
        check_choice("weighting", self.weighting, get_args(Weighting))

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        data = simulated.recording
        read = read_input_output(simulated, "gcc")
        if int(np.count_nonzero(np.diff(read.command))) < 2:
            raise NotIdentifiableError(
                "the command changes at most once in the window, "
                "perhaps because of its limit, so its correlation has "
                "no peak. Use a smaller step, or method='output_error'"
            )
        p_value, least = first_shift(data, "gcc")
        feedback = bool(least)
        gain = float(loop.parameters.get("gain", 1.0))
        shift, between = correlation_peak(
            read.command, np.sign(gain) * read.response, self.weighting, (least, read.longest)
        )
        share = _explained(read, shift)
        peak = shift + between
        delay = max(0.0, peak * read.sample_time - read.late)
        return Read(
            {"delay": delay},
            None,
            float(data.output[0]),
            message=_message(self.weighting, share, feedback, read),
            uncalibrated=(
                "the gcc method reads the peak of a correlation. Its error formulas are valid only "
                "for stationary noise in open loop"
                + (", but the command of this recording depends on the output" if feedback else "")
                + ". Use method='output_error' for an interval"
            ),
            details={
                "weighting": self.weighting,
                "correlation": share,
                "feedback": feedback,
                "feedback_p_value": p_value,
            },
        )


def _explained(read: InputOutput, shift: int) -> float:
    """Correlation coefficient of response and shifted command; refuses insignificant ones."""
    from scipy import special

    size = read.command.size - shift
    coefficient, spread = correlation_coefficient(read.command, read.response, shift)
    needed = -float(special.ndtri(LEVEL)) * np.sqrt(max(spread, 0.25) / size)
    if abs(coefficient) < needed:
        raise NotIdentifiableError(
            "the correlation of command and response is at most "
            f"{abs(coefficient):.2g}, but unrelated signals reach {needed:.2g}. "
            "Either the output does not respond to this command, or noise hides "
            "the response. Check columns and units, or use a larger excitation"
        )
    return abs(coefficient)


def _message(weighting: Weighting, share: float, feedback: bool, read: InputOutput) -> str:
    text = (
        f"peak of the cross-correlation (weighting {weighting!r}), "
        f"where command and response have a correlation of {share:.2f}"
    )
    if feedback:
        text += (
            ". The command depends on the output, so both contain the same noise, "
            "which biases the peak. Use this delay only as an initial value"
        )
    return text + read.remark
