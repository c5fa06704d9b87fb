"""Command and response of a vehicle, sample by sample, with its known dynamics inverted.

With u_k the command held over each sample time h, or its mean over it, an integrator moves by
(y_{k+1} - y_k)/h per second and a first-order plant with time constant c leaves
(y_{k+1} - p y_k)/(1 - p), p = e^(-h/c), behind: in both cases the gain times the mean input between
the two samples, which for the integrator is the command (1-f) u_{k-d} + f u_{k-d-1} at a delay of
(d + f) h. This includes the half sample of the hold; where the plant cannot be inverted, the half
sample is subtracted from the delay.

In a closed loop the sensor noise is in the output and, through the controller, in the command.
Methods that assume that the command causes the output then also find the effect of the output on
the command.

`GCC`: generalised cross-correlation of the command and the response of the vehicle.

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

`ARXScan`: ARX models with every whole number of samples of input delay, as MATLAB's `delayest` fits
them.

    y_k + a_1 y_{k-1} + … = b_1 u_{k-n} + b_2 u_{k-n-1} + … + e_k

is fitted by least squares for each n, and the n with the least loss is the delay, (n - 1) samples
besides the one that a held command takes by itself (Ljung 1999, section 10.1; MATLAB's `delayest`
and `arxstruc`, na = nb = 2). Before the record, all is taken to be at rest.

With `fractional` the plant is taken as known and inverted, so that no a remains. Under the hold, a
delay of (d + f) samples then gives b_1 : b_2 = (1 - f) : f; both are constrained to the sign of the
gain.

Sensor noise does not enter as e does: least squares is biased, more so with more noise, and in a
closed loop the command depends on the noise. There is no interval; the method is for comparison.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

import deadtime.estimation._native as native
from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.validation import whole_number
from deadtime.estimation.data._checks import check_even, check_moves
from deadtime.estimation.data._simulated import SimulatedRecording, commands_over_samples
from deadtime.estimation.data._step_reading import check_decays, read_ringing
from deadtime.estimation.methods._method import OfOne, Read, Run, check_choice
from deadtime.loops import FirstOrder, Integrator
from deadtime.recordings import Recording

#: Fewest samples for a delay by correlation or regression.
FEWEST = 16

#: Largest relative deviation of the time between samples from its median.
EVEN = 0.01

#: Longest delay of the search, as a share of the record.
LONGEST = 0.6

#: The command is taken to follow the output below this p-value.
FEEDBACK = 1e-3


@dataclass(frozen=True, eq=False)
class InputOutput:
    """Input and output of a vehicle behind a delay.

    Attributes
    ----------
    command : ndarray, shape (n,)
        Command of each sample, less the one that keeps the vehicle at its initial output.
    response : ndarray, shape (n,)
        Gain times the mean input of the vehicle over each sample time.
    sample_time : float
        s.
    late : float
        Delay of the response besides the delay itself, s: what was not inverted of plant and hold.
    remark : str
        What else is part of the delay, in words; empty if nothing.
    """

    command: Array
    response: Array
    sample_time: float
    late: float
    remark: str

    @property
    def longest(self) -> int:
        """Longest delay of the search, in samples."""
        return int(LONGEST * self.command.size)


def read_input_output(simulated: SimulatedRecording, method: str) -> InputOutput:
    """Input and output over its window, as far as the plant can be inverted.

    Refuses a constant input or output.
    """
    data, loop = simulated.recording, simulated.loop
    h = data.sample_time
    use = "needs evenly spaced samples. Use method='output_error' or 'waveform'"
    check_even(data, EVEN, f"the {method} method {use}")
    command, _ = commands_over_samples(data, loop)
    if len(data) < FEWEST:
        raise NotIdentifiableError(
            f"{len(data)} samples are too few for the {method} "
            f"method, which needs {FEWEST}: choose a longer window"
        )
    check_moves(data.output, command)
    plant, output = loop.plant, data.output
    moved = output - float(output[0])
    if isinstance(plant, Integrator):
        return InputOutput(command[:-1], np.diff(moved) / h, h, plant.lag, "")
    if isinstance(plant, FirstOrder):
        kept = math.exp(-h / plant.time_constant)
        response = (moved[1:] - kept * moved[:-1]) / (1.0 - kept)
        resting = float(output[0]) / plant.gain
        return InputOutput(command[:-1] - resting, response, h, 0.0, "")
    remark = ". The plant was not inverted, so its lag is part of the delay"
    centred = output - float(output.mean())
    return InputOutput(command - float(command.mean()), centred, h, 0.5 * h, remark)


def feedback_p_value(recording: Recording) -> float:
    """P-value of the test that the command does not depend on the output.

    A Granger (1969) F test: whether the output, up to two samples back, improves the prediction
    of the command by the reference and past commands.
    """
    from scipy import special

    command = recording.command
    if command is None:  # it is then computed from the output
        return 0.0
    found = native.feedback_test(command, recording.reference, recording.output)
    return 1.0 if found is None else float(special.fdtrc(found[1], found[2], found[0]))


def first_shift(recording: Recording, method: str) -> tuple[float, int]:
    """That p-value, and the least delay in samples that a method looks for.

    Feedback within the same sample looks like a response without delay. Refuses a command that
    follows an output which does not decay.
    """
    p_value = feedback_p_value(recording)
    if p_value >= FEEDBACK:
        return p_value, 0
    check_decays(read_ringing(recording), method)
    return p_value, 1


Weighting = Literal["none", "scot", "phat", "prewhitened"]

#: Significance level of the correlation at one shift. Uncorrelated signals exceed it at the best of
#: a hundred shifts in one of a hundred recordings.
CORRELATION_LEVEL = 1e-4


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
        shift, between = native.correlation_peak(
            read.command, np.sign(gain) * read.response, self.weighting, (least, read.longest)
        )
        share = _explained(read, shift)
        delay = max(0.0, (shift + between) * read.sample_time - read.late)
        return Read(
            {"delay": delay},
            None,
            float(data.output[0]),
            message=_gcc_message(self.weighting, share, feedback, read),
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
    coefficient, spread = native.correlation_coefficient(read.command, read.response, shift)
    needed = -float(special.ndtri(CORRELATION_LEVEL)) * np.sqrt(max(spread, 0.25) / size)
    if abs(coefficient) < needed:
        raise NotIdentifiableError(
            "the correlation of command and response is at most "
            f"{abs(coefficient):.2g}, but unrelated signals reach {needed:.2g}. "
            "Either the output does not respond to this command, or noise hides "
            "the response. Check columns and units, or use a larger excitation"
        )
    return abs(coefficient)


def _gcc_message(weighting: Weighting, share: float, feedback: bool, read: InputOutput) -> str:
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


#: Significance level of the F test that the command improves the model.
F_TEST_LEVEL = 1e-4


@dataclass(frozen=True)
class ARXScan(OfOne):
    """Delay of the ARX model with the least loss, as MATLAB's `delayest` finds it.

    Parameters
    ----------
    na, nb : int
        Number of coefficients of past outputs, and of past commands.
    fractional : bool
        Invert the known plant, and find the delay between samples too; `na` and `nb` are not used.

    Raises
    ------
    ValueError
        When `na` is negative or `nb` below 1.
    """

    na: int = 2
    nb: int = 2
    fractional: bool = False

    name: ClassVar[str] = "arx_scan"
    limits: ClassVar[str] = (
        "Without fractional=True the delay is a whole number of samples. Sensor noise "
        "biases the coefficients of the ARX models, especially in a closed loop."
    )

    def __post_init__(self) -> None:
        whole_number("na", self.na, least=0)
        whole_number("nb", self.nb)

    def read(self, run: Run, names: tuple[str, ...]) -> Read:
        """Read the numbers from the window of one recording."""
        loop, simulated = run.loop, run.simulated
        data = simulated.recording
        read = read_input_output(simulated, "arx_scan")
        _, least = first_shift(data, "arx_scan")
        if self.fractional:
            if read.remark:
                raise ValueError(
                    "fractional=True needs an Integrator or a "
                    "FirstOrder, which can be inverted, but the loop has "
                    f"a {type(loop.plant).__name__}: leave fractional out"
                )
            gain = float(loop.parameters["gain"])
            response = np.sign(gain) * read.response
            samples, losses, none = native.held_losses(
                response, read.command, (least, read.longest)
            )
            numbers, tested, best = 2, 2, float(losses[least:].min())
        else:
            numbers, tested = self.na + self.nb, self.nb
            losses, best, none = native.arx_losses(
                data.output - data.output[0],
                read.command,
                (self.na, self.nb),
                (least, read.longest),
            )
            samples = float(least + np.argmin(losses[least:]))
        _check_loss(best, none, data.output.size - numbers, tested)
        delay = max(0.0, samples * read.sample_time - (read.late if self.fractional else 0.0))
        order = "the plant inverted" if self.fractional else f"na={self.na}, nb={self.nb}"
        return Read(
            {"delay": delay},
            None,
            float(data.output[0]),
            message=(
                f"ARX models, {order}: least loss at {samples:.4g} samples of {read.sample_time:g} "
                "s"
            ),
            uncalibrated=(
                "an ARX scan chooses the delay with the smallest loss, so "
                "it has no standard error. Sensor noise also biases the "
                "coefficients. Use method='output_error' for an interval"
            ),
            details={
                "samples": samples,
                "delays": [read.sample_time * late for late in range(losses.size)],
                "losses": losses.tolist(),
            },
        )


def _check_loss(least: float, none: float, freedom: int, tested: int) -> None:
    """Refuse where the command, with `tested` coefficients, improves no more than noise would."""
    from scipy import special

    freedom = max(1, freedom)
    ratio = (none - least) / tested / max(least / freedom, 1e-300)
    if float(special.fdtrc(tested, freedom, max(ratio, 0.0))) > F_TEST_LEVEL:
        raise NotIdentifiableError(
            f"with the command, the loss falls only from {none:.3g} to {least:.3g}, as it "
            "does for noise. Either the output does not respond to this command, or noise "
            "hides the response. Check columns and units, or use a larger excitation"
        )
