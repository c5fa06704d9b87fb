"""Pages and reports: about one recording and gains for it, and about the latencies in a log."""

from deadtime.reports._page import write_report
from deadtime.reports._study import DemoRecording, Study, demo_recording, study
from deadtime.reports.latencies import (
    FilterDelay,
    GainCost,
    Latency,
    LatencyChange,
    LoopLatency,
    Stage,
    compare_latencies,
    latency,
)

__all__ = [
    "DemoRecording",
    "FilterDelay",
    "GainCost",
    "Latency",
    "LatencyChange",
    "LoopLatency",
    "Stage",
    "Study",
    "compare_latencies",
    "demo_recording",
    "latency",
    "study",
    "write_report",
]
