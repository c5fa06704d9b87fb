"""Readers of recordings, one file a format."""

from deadtime._readers.csv import read_recording

__all__ = ["read_recording"]
