"""Recordings of control loops, and their readers, one file for each format."""

from deadtime.recordings._csv import read_recording
from deadtime.recordings._recording import Recording, Step

__all__ = ["Recording", "Step", "read_recording"]
