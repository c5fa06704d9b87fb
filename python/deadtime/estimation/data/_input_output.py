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
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation._native import feedback_test
from deadtime.estimation.data._checks import check_even, check_moves
from deadtime.estimation.data._simulated import SimulatedRecording, commands_over_samples
from deadtime.estimation.data._step_reading import check_decays, read_ringing
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
    found = feedback_test(command, recording.reference, recording.output)
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
