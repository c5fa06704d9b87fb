"""What went into the vehicle and what came out, sample by sample, freed of what is known of it.

With u_k the command held over each sample time h, or its mean over it, an integrator moves by
(y_{k+1} - y_k)/h per second and a first-order plant with time constant c leaves
(y_{k+1} - p y_k)/(1 - p), p = e^(-h/c), behind: in both cases the gain times what arrived between
the two samples, for the integrator the command (1-f) u_{k-d} + f u_{k-d-1} at a delay of (d + f) h.
No half sample of the hold is left over then; where the plant is not undone it is, and is taken off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation.data._commands import commands_over_samples
from deadtime.estimation.data._excitation import check_moves
from deadtime.estimation.data._simulated import SimulatedRecording
from deadtime.loops import ControlLoop, FirstOrder, Integrator
from deadtime.recordings import Recording

__all__ = ["InputOutput", "read_input_output"]

Array = NDArray[np.float64]

#: Fewest samples that tell a delay by correlation or regression.
FEWEST = 16

#: Samples are even where their distances differ by less than this share.
EVEN = 0.01

#: Longest delay that is sought, as a share of the record.
LONGEST = 0.6


@dataclass(frozen=True, eq=False)
class InputOutput:
    """Input and output of a vehicle behind a delay.

    Attributes
    ----------
    command : ndarray, shape (n,)
        Command of each sample, less the one that would have kept the vehicle where it was.
    answer : ndarray, shape (n,)
        What the vehicle was driven by over each sample time, times the gain.
    sample_time : float
        s.
    late : float
        How much later than by the delay the answer comes, s: what was not undone of plant and hold.
    source : str
        Where the commands come from.
    remark : str
        What the delay holds besides itself, in words; empty if nothing.
    """

    command: Array
    answer: Array
    sample_time: float
    late: float
    source: str
    remark: str

    @property
    def longest(self) -> int:
        """Longest delay that is sought, in samples."""
        return int(LONGEST * self.command.size)


def read_input_output(
    recording: Recording, loop: ControlLoop, simulated: SimulatedRecording, method: str
) -> InputOutput:
    """Input and output over the window of `simulated`, refused where there is nothing in them."""
    data = simulated.recording
    steps = np.diff(data.time)
    h = data.sample_time
    if float(np.max(np.abs(steps - h))) > EVEN * h:
        raise NotIdentifiableError(
            f"the samples are {float(steps.min()):g} to {float(steps.max()):g} s apart: the "
            f"{method} method needs even ones; use method='output_error' or 'waveform'"
        )
    command, source = commands_over_samples(data, loop)
    if len(data) < FEWEST:
        raise NotIdentifiableError(
            f"{len(data)} samples are too few for the {method} method, {FEWEST} are needed: widen "
            "the window"
        )
    check_moves(data.output, command)
    return _undone(command, data.output, loop, h, source)


def _undone(command: Array, output: Array, loop: ControlLoop, h: float, source: str) -> InputOutput:
    """Command and answer without the plant, as far as it can be undone."""
    plant = loop.plant
    moved = output - float(output[0])
    if isinstance(plant, Integrator):
        return InputOutput(command[:-1], np.diff(moved) / h, h, plant.lag, source, "")
    if isinstance(plant, FirstOrder):
        kept = math.exp(-h / plant.time_constant)
        answer = (moved[1:] - kept * moved[:-1]) / (1.0 - kept)
        resting = float(output[0]) / plant.gain
        return InputOutput(command[:-1] - resting, answer, h, 0.0, source, "")
    remark = "; the plant was not undone, so its own lag is part of the delay"
    centred = output - float(output.mean())
    return InputOutput(command - float(command.mean()), centred, h, 0.5 * h, source, remark)
