"""The report of a log's latencies: one HTML page with everything in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from deadtime._base.digits import between, stated
from deadtime._base.page import page
from deadtime.logs.latencies._budget import Stage
from deadtime.logs.latencies._latency import Latency
from deadtime.logs.latencies._live import around_the_vehicle
from deadtime.logs.latencies._plots import plot_fit
from deadtime.logs.latencies._relation import LoopLatency
from deadtime.logs.latencies._words import said_of


def render(found: Latency) -> str:
    """The page as text."""
    return page(
        "logs/latencies/page.html",
        title=f"Latencies in {found.source}",
        described=found.vehicle,
        verdict=found.headline(),
        rows=[_row(one) for one in found.estimated],
        all=found._picture(),
        budget=_budget(found.stages),
        filters=[
            (one.name, one.path, stated(one.delay, 0.0, "s"), one.source) for one in found.filters
        ],
        link="" if found.link is None else f"{_capital(found.link.summary())}.",
        fits=[_fit(one) for one in found.estimated],
        refused=[one for one in found.loops if one.estimate is None],
        remarks=found.remarks,
        around=around_the_vehicle(found.estimated),
    )


def _row(one: LoopLatency) -> tuple[str, ...]:
    value, error, (low, high) = one.sum_of()
    assert one.estimate is not None
    adequate = "yes" if one.estimate.adequate else "no"
    times = (stated(value, error, "s"), between(low, high, error, "s"))
    return (one.loop, one.command, *times, adequate)


def _budget(stages: Mapping[str, Sequence[Stage]]) -> list[tuple[str, ...]]:
    """The stages of each loop that has more than one."""
    rows: list[tuple[str, ...]] = []
    for name, some in stages.items():
        for stage in some if len(some) > 1 else ():
            shown = f"— {stage.name}" if stage.part else stage.name
            doubt = "" if stage.adequate else " (not adequate)"
            time = f"{stated(stage.time, stage.stderr, 's')}{doubt}"
            rows.append((name, shown, time, stage.source))
    return rows


def _fit(one: LoopLatency) -> dict[str, object]:
    """A fit with its picture, its numbers and what they cost."""
    start, stop = one.windows[0]
    number = len(one.windows)
    more = f", the best of {number} that were fitted together" if number > 1 else ""
    return {
        "heading": _capital(one.name),
        "sentences": [f"{_capital(words)}." for words in said_of(one)],
        "figure": plot_fit(one),
        "caption": f"The window from {start:.1f} to {stop:.1f} s{more}.",
    }


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
