"""A recording beside the simulation of the loop that made it.

The one place that knows how a window of a recording becomes initial conditions: the loop starts
at rest at the output it has there, samples at the time stamps of the recording, and a sampled
loop still has the commands of its last delay on the way, which the rows before the window tell.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from deadtime._controllers import P
from deadtime._errors import RecordingError
from deadtime._loop import ControlLoop
from deadtime._recording import Recording

__all__ = ["SimulatedRecording"]

Array = NDArray[np.float64]

#: Longest window, in samples of the recording and in samples of the loop.
MOST_SAMPLES = 50_000


class SimulatedRecording:
    """Simulations of one loop at the time stamps of one window of a recording.

    Parameters
    ----------
    recording : Recording
        The whole recording.
    loop : ControlLoop
        What is known of the loop; its delay may be None.
    window : (float or None, float or None) or None
        The part to be simulated, s.
    """

    def __init__(
        self,
        recording: Recording,
        loop: ControlLoop,
        window: tuple[float | None, float | None] | None,
    ) -> None:
        rows = recording.rows(*(window or (None, None)))
        self.loop = loop
        self.recording = recording.window(*(window or (None, None)))
        _check_work(self.recording, loop)
        self._past = _past_commands(recording, loop, rows.start)

    def output(self, values: Mapping[str, float], start: float) -> Array:
        """Output of the loop with these numbers, from rest at the output `start`."""
        window = self.recording
        response = self.loop.replace(**values).simulate(
            window.time,
            window.reference,
            reference_time=window.time,
            initial_output=start,
            command_history=self._past,
        )
        return response.outputs

    def residuals(self, values: Mapping[str, float], start: float) -> Array:
        """Recorded minus simulated output."""
        return self.recording.output - self.output(values, start)


def _check_work(window: Recording, loop: ControlLoop) -> None:
    """Refuse what would take minutes: a fit simulates the window some hundred times."""
    advice = "use a window around one step"
    if len(window) > MOST_SAMPLES:
        raise RecordingError(
            f"{len(window)} samples are more than the {MOST_SAMPLES} that a fit can simulate in "
            f"reasonable time: {advice}, or keep every tenth sample"
        )
    held = 0.0
    if loop.sample_time is not None:
        held = float(window.time[-1] - window.time[0]) / loop.sample_time
    if held > MOST_SAMPLES:
        raise RecordingError(
            f"the recording lasts {window.time[-1] - window.time[0]:g} s, {held:.3g} times the "
            f"sample_time of {loop.sample_time:g} s: {advice}, and check that its time stamps are "
            "seconds"
        )


def _past_commands(recording: Recording, loop: ControlLoop, start: int) -> Array:
    """Commands issued before row `start`, where the loop is sampled and the rows tell them."""
    if loop.sample_time is None or start == 0:
        return np.empty(0)
    if recording.command is not None:
        return recording.command[:start]
    if not isinstance(loop.controller, P):
        return np.empty(0)
    command = loop.controller.Kp * (recording.reference[:start] - recording.output[:start])
    limit = np.inf if loop.limit is None else loop.limit
    return np.clip(command, -limit, limit)
