"""Drawings of fits. Matplotlib is imported when something is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from deadtime._base.drawing import COLOURS, DATA, REFERENCE, bare_axes, empty_figure
from deadtime.estimation._result import DelayEstimate, FittedRun
from deadtime.recordings import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


__all__ = ["plot_estimate", "plot_fits"]


def plot_fits(
    ax: Axes, recording: Recording, fits: Mapping[str, DelayEstimate], unit: str = "m"
) -> None:
    """Recorded output with the fitted ones over it."""
    ax.step(recording.time, recording.reference, where="post", label="reference", **REFERENCE)
    ax.plot(recording.time, recording.output, label="recorded", **DATA)
    for colour, (label, fit) in zip(COLOURS, fits.items(), strict=False):
        window = fit.recording
        ax.plot(window.time, window.output - fit.residuals, color=colour, lw=1.6, label=label)
    ax.set(xlabel="time / s", ylabel=f"output / {unit}")
    ax.legend(frameon=False, fontsize="small")


def plot_estimate(fit: DelayEstimate) -> Figure:
    """Fit over data, below it the residuals, beside it the profile of the delay if it has one."""
    runs = fit.runs
    profiled = fit.has_profile and "delay" in fit.stderr
    width = max(7.0, 3.5 * len(runs)) + 2.6 * profiled
    figure = empty_figure(width, 4.6)
    across = len(runs) + int(profiled)
    ratios = [2.2] * len(runs) + [1.5] * int(profiled)
    grid = figure.add_gridspec(2, across, height_ratios=[3.0, 1.0], width_ratios=ratios)
    for column, run in enumerate(runs):
        upper = bare_axes(figure.add_subplot(grid[0, column]))
        lower = bare_axes(figure.add_subplot(grid[1, column], sharex=upper))
        _plot_run(upper, lower, run, f"{fit.method}, delay {fit.delay:.3f} s")
        if column == 0:
            upper.legend(frameon=False, fontsize="small")
        upper.tick_params(labelbottom=False)
        kind = "white" if fit.whiteness.white else "coloured"
        upper.set_ylabel("output" if column == 0 else "")
        lower.set_ylabel(f"residual\n({kind})" if column == 0 else "")
    if profiled:
        _plot_profile(bare_axes(figure.add_subplot(grid[:, -1])), fit)
    return figure


def _plot_run(upper: Axes, lower: Axes, run: FittedRun, label: str) -> None:
    recording = run.recording
    upper.step(recording.time, recording.reference, where="post", label="reference", **REFERENCE)
    upper.plot(recording.time, recording.output, label="recorded", **DATA)
    fitted = recording.output - run.residuals
    upper.plot(recording.time, fitted, color=COLOURS[0], lw=1.6, label=label)
    lower.plot(recording.time, run.residuals, **DATA)
    lower.axhline(0.0, color="0.6", lw=0.8)
    lower.set(xlabel="time / s")


def _plot_profile(ax: Axes, fit: DelayEstimate) -> None:
    """The t of every delay, with the 95 % interval where it crosses its level."""
    values, t = fit.profile("delay")
    ax.plot(values, t, color=COLOURS[0], lw=1.6)
    for end in fit.ci(0.95):
        ax.axvline(end, **REFERENCE)
    ax.axvline(fit.delay, color=COLOURS[1], lw=1.0)
    ax.axhline(1.96, color="0.6", lw=0.8, ls=":")
    ax.set(xlabel="delay / s", ylabel="t", ylim=(0.0, None), title="profile, and 95 % interval")
    ax.title.set_fontsize("small")
