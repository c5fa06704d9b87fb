"""The command of every row of a recording: logged, or computed from its controller."""

from __future__ import annotations

from dataclasses import replace

from deadtime._base.arrays import Array
from deadtime._base.errors import NotIdentifiableError
from deadtime.estimation.data._simulated import (
    commands_over_samples,
    known_commands,
    moves_between_rows,
)
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: Largest relative difference between the time of a row and the sample time at which a command can
#: be computed from the rows.
ON_SAMPLES = 1e-3


def commands_of(recording: Recording, loop: ControlLoop, computed: bool) -> tuple[Array, str]:
    """The command of every row: logged, or computed from reference and output."""
    if recording.command is not None and not computed:
        if moves_between_rows(recording, loop):
            return commands_over_samples(recording, loop)
        return known_commands(recording, loop)
    found = known_commands(replace(recording, command=None, sent=None), loop)
    if loop.sample_time is None:
        raise NotIdentifiableError(
            "the recording holds no command, and that of a continuous controller cannot be "
            "computed between its rows: log the command, or use method='waveform'"
        )
    between = recording.sample_time
    if abs(between - loop.sample_time) > ON_SAMPLES * loop.sample_time:
        raise NotIdentifiableError(
            f"rows are {between:g} s apart and the controller samples every {loop.sample_time:g} "
            "s: its command cannot be computed from rows that are not its samples; log it, or use "
            "method='waveform'"
        )
    return found
