"""Plots of fits. Matplotlib is imported when something is drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from deadtime._base.drawing import COLOURS, DATA, REFERENCE, bare_axes, check_matplotlib
from deadtime.estimation._result import DelayEstimate, FittedRun
from deadtime.recordings import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


__all__ = ["estimate_axes", "plot_estimate", "plot_fits", "shown_figure"]


def plot_fits(
    ax: Axes, recording: Recording, fits: Mapping[str, DelayEstimate], unit: str = "m"
) -> Axes:
    """Draw the recorded output with the fitted ones over it."""
    ax.step(recording.time, recording.reference, where="post", label="reference", **REFERENCE)
    ax.plot(recording.time, recording.output, label="recorded", **DATA)
    for colour, (label, fit) in zip(COLOURS, fits.items(), strict=False):
        window = fit.recording
        ax.plot(window.time, window.output - fit.residuals, color=colour, lw=1.6, label=label)
    ax.set(xlabel="time / s", ylabel=f"output / {unit}")
    ax.legend(frameon=False, fontsize="small")
    return ax


def estimate_axes(fit: DelayEstimate, figure: Figure | None = None) -> list[Axes]:
    """Lay out the axes of `plot_estimate` on a figure, by default a new one of pyplot."""
    profiled, across = _has_profile(fit), len(fit.runs)
    if figure is None:
        figure = shown_figure(max(7.0, 3.5 * across) + 2.6 * profiled, 4.6)
    ratios = [2.2] * across + [1.5] * profiled
    grid = figure.add_gridspec(2, len(ratios), height_ratios=[3.0, 1.0], width_ratios=ratios)
    axes = []
    for column in range(across):
        upper = figure.add_subplot(grid[0, column])
        axes += [upper, figure.add_subplot(grid[1, column], sharex=upper)]
    return [*axes, figure.add_subplot(grid[:, -1])] if profiled else axes


def plot_estimate(fit: DelayEstimate, axes: Sequence[Axes] | None = None) -> list[Axes]:
    """Draw the fit over the data and the residuals of each run, then the profile of the delay."""
    count = 2 * len(fit.runs) + _has_profile(fit)
    axes = estimate_axes(fit) if axes is None else list(axes)
    if len(axes) != count:
        raise ValueError(f"ax holds {len(axes)} axes: give {count}")
    for one in axes:
        bare_axes(one)
    for column, run in enumerate(fit.runs):
        upper, lower = axes[2 * column : 2 * column + 2]
        _plot_run(upper, lower, run, f"{fit.method}, delay {fit.delay:.3f} s")
        upper.tick_params(labelbottom=False)
        if column == 0:
            upper.legend(frameon=False, fontsize="small")
            upper.set_ylabel("output")
            lower.set_ylabel(f"residual\n({'white' if fit.whiteness.white else 'coloured'})")
    if _has_profile(fit):
        _plot_profile(axes[-1], fit)
    return axes


def shown_figure(width: float, height: float) -> Figure:
    """A new figure of pyplot."""
    check_matplotlib()
    from matplotlib import pyplot

    return pyplot.figure(figsize=(width, height), layout="constrained")


def _has_profile(fit: DelayEstimate) -> bool:
    return fit.has_profile and "delay" in fit.stderr


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
    """The profile t over the delay, with the 95 % interval where it crosses 1.96."""
    values, t = fit.profile("delay")
    ax.plot(values, t, color=COLOURS[0], lw=1.6)
    for end in fit.ci(0.95):
        ax.axvline(end, **REFERENCE)
    ax.axvline(fit.delay, color=COLOURS[1], lw=1.0)
    ax.axhline(1.96, color="0.6", lw=0.8, ls=":")
    ax.set(xlabel="delay / s", ylabel="t", ylim=(0.0, None), title="profile, and 95 % interval")
    ax.title.set_fontsize("small")
