"""Pictures of a proposal: predicted responses over the recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from deadtime._base.drawing import (
    COLOURS,
    DATA,
    REFERENCE,
    Axes,
    Figure,
    bare_axes,
    empty_figure,
    shown_rows,
)

if TYPE_CHECKING:
    from deadtime.tuning.proposal._prediction import Prediction
    from deadtime.tuning.proposal._proposal import Proposal


def plot_proposal(proposal: Proposal, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """The response to the set point, and to the load."""
    if ax is None:
        return figure_of(proposal).axes
    upper, lower = axes = shown_rows(ax, 2)
    _draw(upper, lower, proposal)
    return axes


def figure_of(proposal: Proposal) -> Figure:
    """A figure of its own."""
    figure = empty_figure(7.5, 6.0)
    upper, lower = figure.subplots(2, 1)
    _draw(upper, lower, proposal)
    return figure


def _draw(upper: Axes, lower: Axes, proposal: Proposal) -> None:
    unit = proposal.fit.recording.units.get("output", "")
    for ax in (upper, lower):
        bare_axes(ax)
        ax.set_ylabel(f"output / {unit}" if unit else "output")
    lower.set_xlabel("time / s")
    if proposal.set_point is not None:
        own = (
            "as recorded" if proposal.shows_set_point else f"step of {proposal.set_point.size:.3g}"
        )
        _draw_prediction(upper, proposal, proposal.set_point, proposal.shows_set_point)
        upper.set_title(f"set point, {own}", fontsize="medium")
    if proposal.load is not None:
        _draw_prediction(lower, proposal, proposal.load, proposal.shows_load)
        lower.set_title(
            f"load of {proposal.load.size:.3g}, added to the command", fontsize="medium"
        )


def _draw_prediction(ax: Axes, proposal: Proposal, curve: Prediction, shown: bool) -> None:
    record = proposal.fit.recording
    rows = (record.time >= curve.time[0]) & (record.time <= curve.time[-1])
    if shown or curve.kind == "set point":
        label = "recorded" if curve.kind == "set point" else "recorded, under that load"
        ax.plot(record.time[rows], record.output[rows], label=label, **DATA)
    ax.plot(curve.time, curve.target, label="set point", drawstyle="steps-post", **REFERENCE)
    ax.fill_between(curve.time, curve.low, curve.high, color=COLOURS[0], alpha=0.2, lw=0.0)
    ax.plot(curve.time, curve.outputs, color=COLOURS[0], lw=1.6, label="predicted, with its band")
    ax.set_xlim(float(curve.time[0]), float(curve.time[-1]))
    ax.legend(frameon=False, fontsize="small")
