"""The latency report of a log: the time each loop takes, by stage, and what it costs in gain."""

from deadtime.reports.latencies._budget import Stage
from deadtime.reports.latencies._changes import LatencyChange, compare_latencies
from deadtime.reports.latencies._cost import GainCost
from deadtime.reports.latencies._filters import FilterDelay
from deadtime.reports.latencies._latency import Latency, latency
from deadtime.reports.latencies._relation import LoopLatency

__all__ = [
    "FilterDelay",
    "GainCost",
    "Latency",
    "LatencyChange",
    "LoopLatency",
    "Stage",
    "compare_latencies",
    "latency",
]
