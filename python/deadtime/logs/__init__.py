"""Logs of vehicles: what they hold, the recordings of their loops, and the time each loop takes."""

from deadtime.logs._contents import LogContents, Topic
from deadtime.logs._link import Link
from deadtime.logs._log import Log, LogLoop
from deadtime.logs._open import open_log
from deadtime.logs._series import Series
from deadtime.logs._tuned import tune_loop
from deadtime.logs.bags import Bag, BagTopic, is_bag, open_bag
from deadtime.logs.latencies import (
    Advice,
    FilterDelay,
    GainCost,
    Latency,
    LatencyChange,
    LoopLatency,
    Moves,
    PlainTime,
    PlainTimes,
    Promise,
    Spread,
    Stage,
    advice,
    compare_latencies,
    filter_lines,
    filters_of,
    latency,
    moves_of,
    plain_times,
    promises_of,
    spread_of,
)
from deadtime.logs.latencies._latency import (
    heading_of as heading_of,
    loops_asked_for as loops_asked_for,
)
from deadtime.logs.latencies._table import LatencyTable as LatencyTable

__all__ = [
    "Advice",
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
    "Moves",
    "PlainTime",
    "PlainTimes",
    "Promise",
    "Series",
    "Spread",
    "Stage",
    "Topic",
    "advice",
    "compare_latencies",
    "filter_lines",
    "filters_of",
    "is_bag",
    "latency",
    "moves_of",
    "open_bag",
    "open_log",
    "plain_times",
    "promises_of",
    "spread_of",
    "tune_loop",
]
