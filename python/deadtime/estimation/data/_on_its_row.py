"""A command that was logged one row late or early, put on its row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deadtime.loops import ControlLoop
from deadtime.recordings import Columns, Recording, RecordingCheck

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
    columns = Columns(time, recording.reference, recording.output, None)
    law = columns.commands(loop.replace(limit=largest))
    assert law is not None
    wanted = np.arange(time.size) + rows
    places = np.clip(wanted, 0, time.size - 1)
    known = (places == wanted) & (np.abs(time[places] - time) < NEIGHBOURS * check.row_time)
    return replace(recording, command=np.where(known, command[places], law))
