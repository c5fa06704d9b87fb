"""Recordings of control loops, their checks, and their readers, one file for each format."""

from deadtime.recordings._check import RecordingCheck
from deadtime.recordings._check_rows import Hole
from deadtime.recordings._findings import Finding
from deadtime.recordings._recording import Recording, SentCommands, Step
from deadtime.recordings.logs import Log, LogLoop, Series, open_log
from deadtime.recordings.readers._read import read_recording

__all__ = [
    "Finding",
    "Hole",
    "Log",
    "LogLoop",
    "Recording",
    "RecordingCheck",
    "SentCommands",
    "Series",
    "Step",
    "open_log",
    "read_recording",
]
