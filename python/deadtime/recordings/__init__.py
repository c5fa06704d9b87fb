"""Recordings of control loops, their checks, and their readers, one file for each format."""

from deadtime.recordings._check import RecordingCheck
from deadtime.recordings._check_command import (
    noise_of_second_differences as noise_of_second_differences,
)
from deadtime.recordings._check_excitation import (
    no_excitation as no_excitation,
    no_motion as no_motion,
)
from deadtime.recordings._check_rows import Hole, repeated_rows as repeated_rows
from deadtime.recordings._findings import Columns as Columns, Finding
from deadtime.recordings._first_bytes import (
    HEAD as HEAD,
    format_of as format_of,
    is_table as is_table,
    opened as opened,
    whole as whole,
)
from deadtime.recordings._growing import (
    Row as Row,
    Sent as Sent,
    growing_rows as growing_rows,
)
from deadtime.recordings._recording import (
    LARGEST as LARGEST,
    MINIMUM_SAMPLES as MINIMUM_SAMPLES,
    Recording,
    SentCommands,
    Step,
)
from deadtime.recordings.readers._read import read_recording

__all__ = [
    "Finding",
    "Hole",
    "Recording",
    "RecordingCheck",
    "SentCommands",
    "Step",
    "read_recording",
]
