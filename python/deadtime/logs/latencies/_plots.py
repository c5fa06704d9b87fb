"""Pictures of latencies: the time of each loop, its moves aligned, and each fit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.digits import time_unit
from deadtime._base.drawing import COLOURS, DATA, REFERENCE, Figure, new_figure
from deadtime.logs.latencies._moves import Moves
from deadtime.logs.latencies._relation import LoopLatency

#: Height of a bar's row, and of what is around them, in inches.
ROW, AROUND = 0.34, 1.3

#: Size of the picture of the moves, in inches: it fits a phone as it is.
MOVES = (4.8, 3.6)

#: Most responses that are drawn under their median, and every how many of their points.
DRAWN, EVERY = 40, 2

#: Room above and below the quartiles of the responses, as a share of the move.
ROOM = 0.3


def plot_latency(source: str, loops: Sequence[LoopLatency]) -> Figure:
    """The time of each loop as a bar, with its 95 % interval."""
    if not loops:
        raise ValueError(f"{source}: no loop has a time, so there is nothing to draw")
    figure, ax = new_figure(7.5, AROUND + ROW * len(loops))
    unit, factor = time_unit(float(np.median([loop.time for loop in loops])))
    for place, loop in enumerate(loops):
        reliable = loop.verdict == "reliable"
        alpha = 1.0 if reliable else 0.35
        ax.barh(place, loop.time / factor, color=COLOURS[0], alpha=alpha, height=0.6)
        if reliable:
            ends = [end / factor for end in loop.interval]
            ax.plot(ends, [place, place], color="0.15", lw=1.4, marker="|")
    ax.set_yticks(range(len(loops)))
    doubts = {"reliable": "", "indication": " (indication)"}
    ax.set_yticklabels([f"{loop.loop}, {loop.command}{doubts[loop.verdict]}" for loop in loops])
    ax.invert_yaxis()
    # One loop with a long tail does not hide the others.
    widest = max(loop.time for loop in loops) / factor
    ax.set_xlim(0.0, 1.6 * widest)
    ax.set_xlabel(f"from the command to the response [{unit}]")
    handles = [ax.barh(0, 0, color=COLOURS[0]), *ax.plot([], [], color="0.15", lw=1.4, marker="|")]
    names = ["time", "95 %"]
    figure.legend(handles, names, loc="outside upper center", ncols=2, frameon=False)
    return figure


def plot_moves(
    moves: Moves, fit_time: float | None = None, fit_response: Array | None = None
) -> Figure:
    """All moves of the setpoint aligned, with the responses, and what the fit answers to them.

    Parameters
    ----------
    moves : Moves
        The moves of a loop; at least one.
    fit_time : float, optional
        Half to half over the same moves for the fitted plant, s.
    fit_response : ndarray, shape (n,), optional
        Its median response on the time axis of the moves.
    """
    if not moves.count:
        raise ValueError(f"there is nothing to draw: {moves.reason}")
    figure, ax = new_figure(*MOVES)
    unit, factor = time_unit(float(moves.time[-1]) / 3.0)
    time = moves.time / factor
    every = max(1, -(-moves.count // DRAWN))
    rows = moves.responses[::every, ::EVERY]
    ax.plot(time[::EVERY], rows.T, color="0.5", lw=0.5, alpha=0.4)
    ax.fill_between(time, moves.lower, moves.upper, color=COLOURS[0], alpha=0.2, lw=0.0)
    ax.plot(time, moves.setpoint, color="0.0", lw=1.2, ls="--", label="setpoint")
    label = f"response {moves.shown(moves.median)}: median, quartiles"
    ax.plot(time, moves.response, color=COLOURS[0], lw=2.0, label=label)
    marks = [(moves.median, moves.response, COLOURS[0])]
    if fit_response is not None:
        at = math.nan if fit_time is None else fit_time
        label = f"fit {moves.shown(at)}" if math.isfinite(at) else "fit"
        ax.plot(time, fit_response, color=COLOURS[1], lw=1.4, label=label)
        marks.append((at, fit_response, COLOURS[1]))
    for at, path, colour in marks:
        if math.isfinite(at):
            half = float(np.interp(at, moves.time, np.nan_to_num(path)))
            ax.plot([at / factor] * 2, [0.0, half], color=colour, lw=1.2, ls=":")
            ax.plot(at / factor, half, color=colour, marker="o", ms=6)
    known = np.isfinite(moves.response)
    if known.any():
        ax.set_xlim(time[known][0], time[known][-1])
        low = min(0.0, float(np.nanmin(moves.lower))) - ROOM
        ax.set_ylim(low, max(1.0, float(np.nanmax(moves.upper))) + ROOM)
    ax.set_xlabel(f"time after half of the setpoint's change [{unit}]")
    ax.set_ylabel("share of the change")
    figure.legend(loc="outside upper left", ncols=2, frameon=False, fontsize="small")
    return figure


def plot_fit(loop: LoopLatency) -> Figure:
    """The response of a loop over its best window, and the fitted plant."""
    fit = loop.estimate
    assert fit is not None
    figure, ax = new_figure(7.5, 2.8)
    recording = fit.recording
    unit = recording.units.get("output", "")
    ax.plot(recording.time, recording.output, **DATA, label="response")
    if loop.command == "setpoint":
        ax.step(recording.time, recording.reference, where="post", **REFERENCE, label="setpoint")
    ax.plot(recording.time, fit.fitted, color=COLOURS[1], lw=1.4, label="fit")
    ax.set_xlabel("time after the start of the log [s]")
    ax.set_ylabel(f"{loop.loop} [{unit}]" if unit else loop.loop)
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return figure
