"""Plots of fits and of planned experiments. Matplotlib is imported when something is drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

import deadtime._base.drawing as drawing
from deadtime._base.drawing import REFERENCE, Axes, Figure
from deadtime.estimation._result import DelayEstimate, FittedRun
from deadtime.recordings import Recording

if TYPE_CHECKING:
    from deadtime.estimation.planning._identifiability import Identifiability

#: Half axis of the ellipse that holds 95 % of two Gaussian errors, in standard deviations.
TWO_DIMENSIONS = float(np.sqrt(-2.0 * np.log(0.05)))


def plot_fits(
    ax: Axes, recording: Recording, fits: Mapping[str, DelayEstimate], unit: str = "m"
) -> Axes:
    """Draw the recorded output with the fitted ones over it."""
    _draw_recorded(ax, recording)
    for colour, (label, fit) in zip(drawing.COLOURS, fits.items(), strict=False):
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
    axes = estimate_axes(fit) if axes is None else list(axes)
    _check_axes(axes, 2 * len(fit.runs) + _has_profile(fit))
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


def _check_axes(axes: Sequence[Axes], count: int) -> None:
    """Refuse another number of axes, and bare those of the right one."""
    if len(axes) != count:
        raise ValueError(f"ax has {len(axes)} axes: give {count} matplotlib axes")
    for ax in axes:
        drawing.bare_axes(ax)


def shown_figure(width: float, height: float) -> Figure:
    """A new figure of pyplot."""
    drawing.check_matplotlib()
    from matplotlib import pyplot

    return pyplot.figure(figsize=(width, height), layout="constrained")


def _draw_recorded(ax: Axes, recording: Recording) -> None:
    ax.step(recording.time, recording.reference, where="post", label="reference", **REFERENCE)
    ax.plot(recording.time, recording.output, label="recorded", **drawing.DATA)


def _has_profile(fit: DelayEstimate) -> bool:
    return fit.has_profile and "delay" in fit.stderr


def _plot_run(upper: Axes, lower: Axes, run: FittedRun, label: str) -> None:
    recording = run.recording
    _draw_recorded(upper, recording)
    fitted = recording.output - run.residuals
    upper.plot(recording.time, fitted, color=drawing.COLOURS[0], lw=1.6, label=label)
    lower.plot(recording.time, run.residuals, **drawing.DATA)
    lower.axhline(0.0, color="0.6", lw=0.8)
    lower.set(xlabel="time / s")


def _plot_profile(ax: Axes, fit: DelayEstimate) -> None:
    """The profile t over the delay, with the 95 % interval where it crosses 1.96."""
    values, t = fit.profile("delay")
    ax.plot(values, t, color=drawing.COLOURS[0], lw=1.6)
    for end in fit.ci(0.95):
        ax.axvline(end, **REFERENCE)
    ax.axvline(fit.delay, color=drawing.COLOURS[1], lw=1.0)
    ax.axhline(1.96, color="0.6", lw=0.8, ls=":")
    ax.set(xlabel="delay / s", ylabel="t", ylim=(0.0, None), title="profile, and 95 % interval")
    ax.title.set_fontsize("small")


def plot_identifiability(plan: Identifiability, axes: Sequence[Axes] | None = None) -> list[Axes]:
    """The expected recording, its sensitivities; delay against lag where both are free."""
    both = plan.correlation is not None
    axes = planned_axes(plan) if axes is None else list(axes)
    _check_axes(axes, 2 + both)
    _draw_recording(axes[0], plan)
    _draw_slopes(axes[1], plan)
    if both:
        _draw_ellipse(axes[2], plan)
    return axes


def planned_axes(plan: Identifiability, figure: Figure | None = None) -> list[Axes]:
    """Lay out the axes of `plot_identifiability` on a figure, by default a new one of pyplot."""
    both = plan.correlation is not None
    if figure is None:
        figure = shown_figure(10.0 if both else 7.0, 5.0)
    grid = figure.add_gridspec(2, 1 + both, width_ratios=[3.0, 2.0][: 1 + both])
    upper = figure.add_subplot(grid[0, 0])
    axes = [upper, figure.add_subplot(grid[1, 0], sharex=upper)]
    return [*axes, figure.add_subplot(grid[:, 1])] if both else axes


def _draw_recording(ax: Axes, plan: Identifiability) -> None:
    recording = plan.recording
    assert recording.command is not None
    ax.step(recording.time, recording.reference, where="post", label="reference", **REFERENCE)
    ax.plot(recording.time, recording.output, color="0.15", lw=1.4, label="output")
    held: Literal["post", "mid"] = "post" if plan.loop.is_sampled else "mid"
    ax.step(recording.time, recording.command, where=held, color="0.6", lw=0.8, label="command")
    _legend_above(ax, f"{plan.experiment.name}, {plan.noise}:")
    ax.tick_params(labelbottom=False)


def _draw_slopes(ax: Axes, plan: Identifiability) -> None:
    """Effect of an error as large as the bound; similar curves are hard to tell apart."""
    bound = plan.bound
    for name, colour in zip(plan.free, drawing.COLOURS, strict=False):
        error = bound.stderr[name]
        moved = bound.sensitivities[name] * error / bound.noise.white
        shown = f"{error:.2g}" if name == "gain" else f"{1e3 * error:.2g} ms"
        ax.plot(plan.recording.time, moved, color=colour, lw=1.2, label=f"{name} ({shown})")
    ax.set(xlabel="time (s)", ylabel="change of the output\nin units of the white noise")
    _legend_above(ax, "for one standard error of")


def _legend_above(ax: Axes, title: str) -> None:
    ax.legend(
        title=title,
        ncols=3,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        frameon=False,
        fontsize="small",
    )


def _draw_ellipse(ax: Axes, plan: Identifiability) -> None:
    """Region of 95 % of the estimates of an efficient method; neither can be below zero."""
    slow = next(name for name in plan.free if name not in ("delay", "gain"))
    centre = np.array([plan.loop.parameters["delay"], plan.loop.parameters[slow]])
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    bounds = {"command logged": plan.command_logged, "reference only": plan.reference_only}
    for (label, bound), colour in zip(bounds.items(), drawing.COLOURS, strict=False):
        if bound is None:
            continue
        places = [bound.free.index("delay"), bound.free.index(slow)]
        root = np.linalg.cholesky(bound.cov[np.ix_(places, places)])
        x, y = 1e3 * (centre[:, None] + TWO_DIMENSIONS * root @ circle)
        ax.plot(x, y, color=colour, lw=1.3, label=label)
    low, high = ax.get_ylim()
    if low < 0.0:
        ax.axhspan(low, 0.0, color="0.9", zorder=0)
        ax.set_ylim(low, high)
    ax.plot(*(1e3 * centre), "k+")
    name = slow.replace("_", " ")
    ax.set(xlabel="delay (ms)", ylabel=f"{name} (ms)")
    error = 1e3 * plan.bound.stderr[f"delay+{slow}"]
    ax.set_title(f"95 % of the estimates\ndelay + {name} ± {error:.2g} ms", fontsize="medium")
    ax.legend(fontsize="small")
