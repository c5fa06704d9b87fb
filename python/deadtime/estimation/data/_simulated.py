"""Commands of a recording, and simulations of the recorded loop over a window of it.

The command of every row is the logged one, or computed from the controller. One that was logged one
row late or early is put on its row.

`SimulatedRecording` alone turns a window of a recording into initial conditions: the loop starts
at rest at its output at the beginning of the window, the simulation is evaluated at the time stamps
of the recording, and in a sampled loop the commands of the last delay before the window, which its
rows hold, are still to arrive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError, RecordingError
from deadtime._base.validation import OpenRange
from deadtime.estimation._native import LoopMisfit
from deadtime.estimation.data._checks import start_and_span
from deadtime.loops import ControlLoop, P
from deadtime.recordings import Columns, Recording, RecordingCheck

#: A logged command is taken to be the P controller's where the two differ by less than this share
#: of the command's standard deviation. Larger values accept more noise in the log, and more foreign
#: commands.
ALIKE = 0.2

#: Largest relative difference between the time of a row and the sample time at which a command can
#: be computed from the rows.
ON_SAMPLES = 1e-3

#: Longest window, in samples of the recording and of the loop (bounds the time of a fit).
MOST_SAMPLES = 50_000

#: Shortest delay and lag of a continuous loop, as a share of the window and of the time between two
#: samples. Shorter ones take long to simulate and cannot be distinguished from zero.
SHORTEST_OF_WINDOW, SHORTEST_OF_SAMPLE = 1.0 / 2000.0, 1.0 / 4.0

#: Bound of the misfit of simulations that diverge, in units of the excitation.
LARGEST_MISFIT = 1e3


def known_commands(recording: Recording, loop: ControlLoop) -> tuple[Array, str]:
    """Commands within the limit, and their source in words.

    The command of a P controller depends on its sample alone, so it can be computed from the log;
    the command of other controllers depends on samples before the log.
    """
    if recording.command is not None:
        return limited(recording.command, loop), "logged"
    command = commands_by_law(recording, loop)
    if command is None:
        raise NotIdentifiableError(
            "the recording has no command, and a command can be computed from reference and "
            "output only for a P controller. Log the command, or use method='waveform'"
        )
    return command, "computed from reference and output"


def commands_by_law(recording: Recording, loop: ControlLoop) -> Array | None:
    """Commands of a P controller, within its limit; None of other controllers."""
    return Columns(recording.time, recording.reference, recording.output, None).commands(loop)


def limited(command: Array, loop: ControlLoop) -> Array:
    """Commands within the limit of the loop."""
    limit = math.inf if loop.limit is None else loop.limit
    return np.clip(command, -limit, limit)


def moves_between_rows(recording: Recording, loop: ControlLoop) -> bool:
    """Whether a logged command is that of a continuous P controller, which is not held.

    Any other logged command, such as a setpoint, is taken as held between rows.
    """
    if loop.is_sampled or recording.command is None or recording.sent is not None:
        return False
    computed, logged = commands_by_law(recording, loop), limited(recording.command, loop)
    if computed is None:
        return False
    return float(np.std(computed - logged)) < ALIKE * float(np.std(logged))


def commands_over_samples(recording: Recording, loop: ControlLoop) -> tuple[Array, str]:
    """Mean command from each sample to the next, and the source of the commands in words.

    A sampled loop holds its command. In a continuous loop the mean is that of a straight line
    between the samples (second order); where the reference steps at a sample, the line ends just
    before the step.
    """
    command, source = known_commands(recording, loop)
    if loop.is_sampled:
        return command, source
    before = command[1:].copy()
    jumps = np.flatnonzero(np.diff(recording.reference))
    if jumps.size and isinstance(loop.controller, P):
        Kp, output = loop.controller.Kp, recording.output[jumps + 1]
        old, new = (
            limited(Kp * (recording.reference[rows] - output), loop) for rows in (jumps, jumps + 1)
        )
        before[jumps] -= new - old
    return np.append(0.5 * (command[:-1] + before), command[-1]), source


def commands_of(recording: Recording, loop: ControlLoop, computed: bool) -> tuple[Array, str]:
    """The command of every row: logged, or computed from reference and output."""
    if recording.command is not None and not computed:
        if moves_between_rows(recording, loop):
            return commands_over_samples(recording, loop)
        return known_commands(recording, loop)
    found = known_commands(replace(recording, command=None, sent=None), loop)
    if loop.sample_time is None:
        raise NotIdentifiableError(
            "the recording has no command, and the command of a continuous controller cannot "
            "be computed between rows. Log the command, or use method='waveform'"
        )
    between = recording.sample_time
    if abs(between - loop.sample_time) > ON_SAMPLES * loop.sample_time:
        raise NotIdentifiableError(
            f"rows are {between:g} s apart, but the controller samples every "
            f"{loop.sample_time:g} s, so its command cannot be computed from "
            "such rows. Log the command, or use method='waveform'"
        )
    return found


class SimulatedRecording:
    """Simulations of one loop at the time stamps of one window of a recording.

    Parameters
    ----------
    recording : Recording
        The whole recording.
    loop : ControlLoop
        The known part of the loop; its delay may be None.
    window : (float or None, float or None)
        The part that is simulated, s.
    """

    def __init__(
        self, recording: Recording, loop: ControlLoop, window: OpenRange = (None, None)
    ) -> None:
        rows = recording.rows(*window)
        # The recorded output is the one that the controller received, wherever the delay is.
        self.loop = loop.replace(delay_path="command")
        self.recording = recording.window(*window)
        _check_work(self.recording, loop)
        self._past = _past_commands(recording, loop, rows.start)

    def output(self, values: Mapping[str, float], start: float) -> Array:
        """Output of the loop with these parameters, from rest at the output `start`.

        With `start` among them, the time stamp t of an output was at t - start.
        """
        window, loop, period = self.recording, self.loop.specification, self.loop.sample_time
        late = values.get("start", 0.0)
        phase = 0.0 if period is None else late % period
        return loop.outputs_at(
            {name: value for name, value in values.items() if name != "start"},
            window.time - late,
            (window.reference, window.time),
            start,
            (self._past, 0.0 if phase == period else phase),
        )

    def misfit(self, names: Sequence[str], start: float | None, size: float) -> LoopMisfit:
        """The misfit of the kernel over these numbers, and over the output at the start if unknown.

        `size` is that of the excitation.
        """
        window, loop = self.recording, self.loop.specification
        smooth = loop.controller._filter
        on_samples = smooth is not None and smooth.discretisation is not None
        given = loop.plant._given(loop.plant.parameters) is not None
        arrays = window.time, window.reference, window.output, self._past
        rows = arrays, (window.sample_time, size, LARGEST_MISFIT * size)
        return LoopMisfit(
            loop.kernel,
            rows,
            names,
            start,
            is_smooth=not (on_samples and self.loop.is_sampled),
            polynomials=loop.polynomials_of if given else None,
        )

    def residuals(self, values: Mapping[str, float], start: float) -> Array:
        """Recorded minus simulated output."""
        return self.recording.output - self.output(values, start)


def shortest_time(window: Recording) -> float:
    """Shortest delay and lag of a continuous loop that are searched, s."""
    _, span = start_and_span(window)
    return min(SHORTEST_OF_WINDOW * span, SHORTEST_OF_SAMPLE * window.sample_time)


def _check_work(window: Recording, loop: ControlLoop) -> None:
    """Refuse windows whose fit, some hundred simulations, would take minutes."""
    advice = "choose a window around one step"
    if len(window) > MOST_SAMPLES:
        raise RecordingError(
            f"{len(window)} samples are more than the {MOST_SAMPLES} that a fit "
            f"can simulate in reasonable time: {advice}, or keep every tenth sample"
        )
    span = float(window.time[-1] - window.time[0])
    held = span / (loop.sample_time or math.inf)
    if held > MOST_SAMPLES:
        raise RecordingError(
            f"the recording lasts {span:g} s, which "
            f"is {held:.3g} times the sample_time of {loop.sample_time:g} s: "
            f"{advice}, and check that the time stamps are seconds"
        )


def _past_commands(recording: Recording, loop: ControlLoop, start: int) -> Array:
    """Commands before row `start`, where the loop is sampled and the rows determine them."""
    if loop.sample_time is None or start == 0:
        return np.empty(0)
    command = recording.command
    if command is None:
        command = commands_by_law(recording, loop)
    return np.empty(0) if command is None else command[:start]


#: Rows further apart than so many times the usual are not neighbours.
NEIGHBOURS = 1.5

#: By how many rows a command is taken later, by what a check finds.
WAYS = {"command_late": 1, "command_early": -1}


def rows_off(check: RecordingCheck) -> int:
    """By how many rows a command was logged late, as the law of its controller shows."""
    return next((WAYS[finding.code] for finding in check.findings if finding.code in WAYS), 0)


def on_its_row(recording: Recording, loop: ControlLoop, check: RecordingCheck) -> Recording:
    """The recording with each command on its row; by the law where there is none."""
    rows = rows_off(check)
    assert recording.command is not None
    time, command = recording.time, recording.command
    largest = loop.limit or check.limit_seen or float(np.max(np.abs(command)))
    law = commands_by_law(recording, loop.replace(limit=largest))
    assert law is not None
    wanted = np.arange(time.size) + rows
    places = np.clip(wanted, 0, time.size - 1)
    known = (places == wanted) & (np.abs(time[places] - time) < NEIGHBOURS * check.row_time)
    return replace(recording, command=np.where(known, command[places], law))
