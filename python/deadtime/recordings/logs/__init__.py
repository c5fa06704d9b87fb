"""Logs of autopilots: what they hold, and the recordings of their loops."""

from deadtime.recordings.logs._contents import LogContents, Topic
from deadtime.recordings.logs._link import Link
from deadtime.recordings.logs._log import Log, LogLoop
from deadtime.recordings.logs._open import open_log
from deadtime.recordings.logs._series import Series

__all__ = ["Link", "Log", "LogContents", "LogLoop", "Series", "Topic", "open_log"]
