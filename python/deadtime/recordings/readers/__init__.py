"""Readers of recordings, one file for each format, behind `read_recording`."""
