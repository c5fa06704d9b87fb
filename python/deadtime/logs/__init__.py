"""Logs of vehicles: what they hold, the recordings of their loops, and the time each loop takes."""

from deadtime.logs._contents import LogContents, Topic
from deadtime.logs._link import Link
from deadtime.logs._log import Log, LogLoop
from deadtime.logs._open import open_log
from deadtime.logs._series import Series
from deadtime.logs.bags import Bag, BagTopic, is_bag, open_bag, recording_of_fields
from deadtime.logs.latencies import (
    FilterDelay,
    GainCost,
    Latency,
    LatencyChange,
    LoopLatency,
    Stage,
    compare_latencies,
    latency,
)
from deadtime.logs.latencies._latency import loops_asked_for as loops_asked_for

__all__ = [
    "Bag",
    "BagTopic",
    "FilterDelay",
    "GainCost",
    "Latency",
    "LatencyChange",
    "Link",
    "Log",
    "LogContents",
    "LogLoop",
    "LoopLatency",
    "Series",
    "Stage",
    "Topic",
    "compare_latencies",
    "is_bag",
    "latency",
    "open_bag",
    "open_log",
    "recording_of_fields",
]
