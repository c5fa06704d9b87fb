"""The report of a log's latencies: one HTML page with everything in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from deadtime._base.digits import between, stated
from deadtime._base.page import escaped, page, picture, table, table_row
from deadtime.recordings.logs import Link
from deadtime.reports.latencies._budget import Stage
from deadtime.reports.latencies._filters import FilterDelay
from deadtime.reports.latencies._plots import plot_fit, plot_latency
from deadtime.reports.latencies._relation import LoopLatency
from deadtime.reports.latencies._words import cost_in_words, numbers_of, why_inadequate

HEADS = ("loop", "from", "delay and lag", "95 % interval", "adequate")
STYLE = ".refused { color: #555; } td { vertical-align: top; }"


def render(
    source: str,
    vehicle: str,
    headline: str,
    loops: Sequence[LoopLatency],
    stages: Mapping[str, Sequence[Stage]],
    filters: Sequence[FilterDelay],
    remarks: Sequence[str],
    link: Link | None,
) -> str:
    """The page as text."""
    estimated = [one for one in loops if one.estimate is not None]
    body = [
        f"<p>{escaped(vehicle)}</p>",
        f'<p class="verdict">{escaped(headline)}</p>',
    ]
    if estimated:
        body += [
            "<h2>How long each loop takes to respond</h2>",
            table(HEADS, map(_row, estimated)),
            picture(
                "all",
                plot_latency(source, estimated),
                "Delay and lag of each loop; pale: not adequate.",
            ),
            "<p>From the setpoint the loop is closed: this is how well it follows. From what the "
            "controller commands (“actuator”) it is the vehicle alone, which decides the gains. "
            "Where a fit is not adequate, its interval need not hold the truth.</p>",
        ]
    budget = _budget(stages)
    if budget:
        body += ["<h2>Where the time goes</h2>", budget]
    if filters:
        rows = [
            table_row((one.name, one.path, stated(one.delay, 0.0, "s"), one.source), "td", 4)
            for one in filters
        ]
        body += [
            "<h2>Filters that the log names</h2>",
            table(("filter", "on", "delay at low frequencies", "parameters"), rows),
        ]
    if link is not None:
        words = link.summary()
        body += ["<h2>The link</h2>", f"<p>{escaped(words[0].upper() + words[1:])}.</p>"]
    for number, one in enumerate(estimated):
        body += _fit(number, one)
    refused = [one for one in loops if one.estimate is None]
    if refused:
        points = "".join(f"<li>{escaped(one.name)}: {escaped(one.refusal)}</li>" for one in refused)
        body += ["<h2>What the log does not tell</h2>", f'<ul class="refused">{points}</ul>']
    body += [f"<p>{escaped(remark)}</p>" for remark in remarks]
    return page(f"Latencies in {source}", body, STYLE)


def _row(one: LoopLatency) -> str:
    value, error, (low, high) = one.sum_of()
    assert one.estimate is not None
    adequate = "yes" if one.estimate.adequate else "no"
    cells = (one.loop, one.command, stated(value, error, "s"), between(low, high, error, "s"))
    return table_row((*cells, adequate), "td", len(HEADS))


def _budget(stages: Mapping[str, Sequence[Stage]]) -> str:
    """A table of the stages of each loop that has more than one."""
    rows = []
    for name, some in stages.items():
        if len(some) < 2:
            continue
        for stage in some:
            shown = f"— {stage.name}" if stage.part else stage.name
            doubt = "" if stage.adequate else " (not adequate)"
            time = f"{stated(stage.time, stage.stderr, 's')}{doubt}"
            rows.append(table_row((name, shown, time, stage.source), "td", 4))
    return table(("loop", "stage", "time", "source"), rows) if rows else ""


def _fit(number: int, one: LoopLatency) -> list[str]:
    """A fit with its picture, its numbers and what they cost."""
    fit = one.estimate
    assert fit is not None
    start, stop = one.windows[0]
    further = len(one.windows) - 1
    caption = f"The window from {start:.1f} to {stop:.1f} s" + (
        f", the best of {further + 1} that were fitted together." if further else "."
    )
    said = [f"{one.headline()}.", f"{', '.join(numbers_of(fit))}."]
    if not fit.adequate:
        said.append(f"Not adequate: {why_inadequate(fit)}.")
    if one.cost is not None:
        words = cost_in_words(one)
        said.append(f"{words[0].upper()}{words[1:]}.")
    return [
        f"<h2>{escaped(one.name[0].upper() + one.name[1:])}</h2>",
        *(f"<p>{escaped(sentence)}</p>" for sentence in said),
        picture(f"fit-{number}", plot_fit(one), caption),
    ]
