"""The latency report of a log: the time each loop takes, by stage, and what it costs in gain."""

from deadtime.logs.latencies._budget import Stage
from deadtime.logs.latencies._changes import LatencyChange, compare_latencies
from deadtime.logs.latencies._cost import GainCost
from deadtime.logs.latencies._filters import FilterDelay
from deadtime.logs.latencies._latency import Latency, latency
from deadtime.logs.latencies._relation import LoopLatency

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
