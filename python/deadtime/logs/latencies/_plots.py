"""Pictures of latencies: delay and lag of each loop, and each fit over its data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deadtime._base.digits import time_unit
from deadtime._base.drawing import COLOURS, DATA, REFERENCE, Axes, Figure, bare_axes, new_figure
from deadtime.logs.latencies._relation import LoopLatency

#: Height of a bar's row, and of what is around them, in inches.
ROW, AROUND = 0.34, 1.3


def plot_latency(source: str, told: Sequence[LoopLatency]) -> Figure:
    """Delay and lag of each loop as bars, with the 95 % interval of their sum."""
    if not told:
        raise ValueError(f"{source}: no loop tells how long it takes, so nothing is drawn")
    figure, ax = new_figure(7.5, AROUND + ROW * len(told))
    unit, factor = time_unit(float(np.median([one.time for one in told])))
    for place, one in enumerate(told):
        assert one.estimate is not None
        reliable = one.verdict == "reliable"
        look = {"alpha": 1.0 if reliable else 0.35, "height": 0.6}
        delay = one.estimate.delay / factor
        ax.barh(place, delay, color=COLOURS[0], **look)
        ax.barh(place, one.time / factor - delay, left=delay, color=COLOURS[1], **look)
        if reliable:
            ends = [end / factor for end in one.interval]
            ax.plot(ends, [place, place], color="0.15", lw=1.4, marker="|")
    ax.set_yticks(range(len(told)))
    doubts = {"reliable": "", "indication": " (indication)"}
    ax.set_yticklabels([f"{one.loop}, {one.command}{doubts[one.verdict]}" for one in told])
    ax.invert_yaxis()
    # One loop with a long tail does not hide the others.
    widest = max(one.time for one in told) / factor
    ax.set_xlim(0.0, 1.6 * widest)
    ax.set_xlabel(f"from the command to the response [{unit}]")
    handles = [ax.barh(0, 0, color=colour) for colour in COLOURS[:2]]
    handles += ax.plot([], [], color="0.15", lw=1.4, marker="|")
    names = ["delay", "lag", "95 % of both"]
    figure.legend(handles, names, loc="outside upper center", ncols=3, frameon=False)
    return figure


def plot_fit(one: LoopLatency) -> Figure:
    """The response of a loop over its best window, and the fitted plant."""
    figure, ax = new_figure(7.5, 2.8)
    draw_fit(ax, one)
    return figure


def draw_fit(ax: Axes, one: LoopLatency) -> None:
    """Draw command, response and fit of a loop."""
    fit = one.estimate
    assert fit is not None
    bare_axes(ax)
    recording = fit.recording
    unit = recording.units.get("output", "")
    ax.plot(recording.time, recording.output, **DATA, label="response")
    if one.command == "setpoint":
        ax.step(recording.time, recording.reference, where="post", **REFERENCE, label="setpoint")
    ax.plot(recording.time, fit.fitted, color=COLOURS[1], lw=1.4, label="fit")
    ax.set_xlabel("time from the start of the log [s]")
    ax.set_ylabel(f"{one.loop} [{unit}]" if unit else one.loop)
    ax.figure.legend(loc="outside upper center", ncols=3, frameon=False)
