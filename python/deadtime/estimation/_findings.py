"""What a check finds binds: it is corrected and said, or the answer is an indication.

Corrected are a command that was logged one row late or early, where reference and P law show it;
a sample time that is not given; and a limit that is not given, for a fit of the loop. Anything else
that may move the delay by more than a share of its interval makes the answer an indication.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from deadtime._base.digits import shown
from deadtime.estimation._result import REASONS, DelayEstimate
from deadtime.estimation.data._on_its_row import on_its_row, rows_off
from deadtime.estimation.methods._method import Run
from deadtime.recordings import Finding

#: Share of the 95 % interval of the delay by which a finding may move it unsaid. Larger: intervals
#: hold the truth less often than they say; smaller: answers that hold are doubted.
LEAST_MOVE = 0.25

#: Findings that concern a fit of the loop, and not one of the response to a logged command.
OF_THE_LOOP = ("command_differs", "command_gain", "command_offset", "output_range", "rows_repeated")


def command_on_its_row(run: Run) -> Run:
    """The run with its command moved, where it was logged one row late or early.

    Commands with times of their own are on no row.
    """
    assert run.check is not None
    if run.recording.sent is not None:
        return run
    rows = rows_off(run.check)
    if not rows:
        return run
    said = (
        f"the command was logged one row {'late' if rows > 0 else 'early'}, as the equation of "
        f"the controller shows, and was shifted by {shown(run.check.row_time, math.nan, 's')}"
    )
    recording = on_its_row(run.recording, run.loop, run.check)
    check = recording.check(run.loop, run.window)
    return run._replace(recording=recording, check=check, corrected=(*run.corrected, said))


def loop_as_seen(run: Run, *, of_loop: bool) -> Run:
    """The run with the sample time that its rows show, and for a fit of the loop the limit."""
    assert run.check is not None
    loop, said = run.loop, list(run.corrected)
    for finding in run.check.findings:
        if finding.severity != "warning":
            continue
        if finding.code == "sample_time_seen":
            seen = run.check.sample_time_seen
            loop = loop.replace(sample_time=seen)
            said.append(f"sampled every {shown(seen or 0.0, math.nan, 's')}, as the rows show")
        elif finding.code == "limit_seen" and of_loop:
            loop = loop.replace(limit=run.check.limit_seen)
            said.append(f"with the limit of {run.check.limit_seen:.6g} that the command shows")
    return run._replace(loop=loop, corrected=tuple(said))


def bound(fit: DelayEstimate, runs: Sequence[Run], *, of_loop: bool) -> DelayEstimate:
    """The estimate with what was put right; an indication where a finding may move the delay."""
    said = dict.fromkeys(words for run in runs for words in run.corrected)
    if said:
        known, begins, reasons = fit.message.partition(REASONS)
        fit = replace(fit, message=f"{'; '.join((known, *said))}{begins}{reasons}")
    doubts = dict.fromkeys(
        f"{finding.message}; {finding.effect}"
        for run in runs
        for finding in (run.check.findings if run.check is not None else ())
        if finding.severity == "warning" and (of_loop or finding.code not in OF_THE_LOOP)
        if _may_move_delay(finding, fit)
    )
    for why in doubts:
        fit = fit.doubted(why)
    return fit


def _may_move_delay(finding: Finding, fit: DelayEstimate) -> bool:
    """Whether a finding may move the delay by more than a share of its interval."""
    moved = finding.shift + finding.share * fit.delay
    if math.isinf(moved) or not moved:
        return bool(moved)
    if "delay" not in fit.free or not fit.calibrated:
        return False
    low, high = fit.ci(0.95)
    return moved > LEAST_MOVE * (high - low)
