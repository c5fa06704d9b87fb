"""The latency report of a log: the time each loop takes, by stage, and what it costs in gain."""

from deadtime.logs.latencies._advice import Advice, advice
from deadtime.logs.latencies._budget import Stage
from deadtime.logs.latencies._changes import LatencyChange, compare_latencies
from deadtime.logs.latencies._cost import GainCost
from deadtime.logs.latencies._filters import FilterDelay, filter_lines, filters_of
from deadtime.logs.latencies._latency import Latency, latency
from deadtime.logs.latencies._modelled import modelled
from deadtime.logs.latencies._moves import Moves, aligned, moves_of
from deadtime.logs.latencies._plain import (
    Difference,
    PlainTime,
    PlainTimes,
    differences,
    plain_times,
)
from deadtime.logs.latencies._promise import Promise, promised, promises_of
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.logs.latencies._setpoint_moves import Move
from deadtime.logs.latencies._spread import Spread, spread_of

__all__ = [
    "Advice",
    "Difference",
    "FilterDelay",
    "GainCost",
    "Latency",
    "LatencyChange",
    "LoopLatency",
    "Move",
    "Moves",
    "PlainTime",
    "PlainTimes",
    "Promise",
    "Spread",
    "Stage",
    "advice",
    "aligned",
    "compare_latencies",
    "differences",
    "filter_lines",
    "filters_of",
    "latency",
    "modelled",
    "moves_of",
    "plain_times",
    "promised",
    "promises_of",
    "spread_of",
]
