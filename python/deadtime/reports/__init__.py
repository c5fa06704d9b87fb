"""A page about one recording and gains for it."""

from deadtime.reports._page import write_report
from deadtime.reports._study import DemoRecording, Study, demo_recording, study

__all__ = ["DemoRecording", "Study", "demo_recording", "study", "write_report"]
