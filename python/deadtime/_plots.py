"""Everything that is drawn. Matplotlib is imported when something is drawn, not before."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from deadtime._chains import Chain
    from deadtime._estimation import DelayEstimate
    from deadtime._recording import Recording
    from deadtime._response import Response
    from deadtime._rootset import RootSet
    from deadtime._stability import StabilityMap

__all__ = [
    "as_svg",
    "new_figure",
    "plot_estimate",
    "plot_fits",
    "plot_responses",
    "plot_root_set",
    "plot_stability_map",
]

DATA: dict[str, Any] = {"color": "0.35", "lw": 0.9, "marker": ".", "ms": 3}
REFERENCE: dict[str, Any] = {"color": "0.6", "lw": 1.0, "ls": "--"}
CHAIN: dict[str, Any] = {"color": "#d1481f", "lw": 1.0, "ls": "--", "zorder": 3}
COLOURS = ("#0b6fb8", "#d1481f", "#2f8f4e", "#8a4fbf")


def new_figure(width: float = 7.0, height: float = 4.0, rows: int = 1) -> tuple[Figure, Any]:
    """A figure that belongs to nobody's window, and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    ratios = None if rows == 1 else [3.0, *([1.0] * (rows - 1))]
    axes = figure.subplots(rows, 1, sharex=rows > 1, height_ratios=ratios)
    for one in np.atleast_1d(axes):
        one.spines[["top", "right"]].set_visible(False)
        one.grid(alpha=0.25)
    return figure, axes


def shown_axes(ax: Axes | None) -> Axes:
    """The given axes, or those of a new pyplot figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def as_svg(figure: Figure, name: str) -> str:
    """A figure as an SVG element to be put into a page; the same picture gives the same text.

    Matplotlib names the parts of every picture alike; `name` before them tells the pictures of
    one page apart.
    """
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "deadtime", "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    drawing = text.getvalue()
    drawing = drawing[drawing.index("<svg") :]
    return re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", drawing)


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
    """Fit over data, and below it the residuals."""
    figure, (upper, lower) = new_figure(7.0, 5.0, rows=2)
    plot_fits(upper, fit.recording, {f"{fit.method}, delay {fit.delay:.3f} s": fit})
    upper.set_xlabel("")
    kind = "white" if fit.whiteness.white else "coloured"
    lower.plot(fit.recording.time, fit.residuals, **DATA)
    lower.axhline(0.0, color="0.6", lw=0.8)
    lower.set(xlabel="time / s", ylabel=f"residual / m\n({kind})")
    return figure


def plot_responses(ax: Axes, responses: Mapping[str, Response], unit: str = "m") -> None:
    """Several responses to the same reference."""
    for colour, (label, response) in zip(COLOURS, responses.items(), strict=False):
        ax.plot(response.time, response.outputs, color=colour, lw=1.6, label=label)
    ax.axhline(1.0, **REFERENCE)
    ax.set(xlabel="time / s", ylabel=f"output / {unit}")
    ax.legend(frameon=False, fontsize="small")


def plot_root_set(ax: Axes, roots: RootSet, chains: Sequence[Chain] = ()) -> None:
    """Characteristic roots in the complex plane, multiple ones with their multiplicity.

    The laws of `chains` are drawn as far up and down as there are roots.
    """
    values = np.asarray(roots.roots)
    ax.axvline(0.0, color="0.6", lw=0.8)
    size = 7.0 if values.size < 60 else 4.5
    ax.plot(values.real, values.imag, "x", color=COLOURS[0], ms=size, mew=size / 4, label="roots")
    for root, multiplicity in zip(values, roots.multiplicities, strict=True):
        if multiplicity > 1:
            ax.annotate(
                f"×{multiplicity}", (root.real, root.imag), (5, 5), textcoords="offset points"
            )
    if chains and values.size:
        top, bottom = float(values.imag.max()), float(values.imag.min())
        for number, chain in enumerate(chains):
            # The law says nothing about the first few roots: it begins where the bend has begun.
            foot = abs(chain.bend)
            for end in (top, bottom):
                if abs(end) > foot:
                    heights = np.sign(end) * np.geomspace(max(foot, 1e-3 * abs(end)), abs(end), 200)
                    label = "chains" if number == 0 and end == top else None
                    ax.plot(chain.real_part(heights), heights, label=label, **CHAIN)
        ax.legend(frameon=False, fontsize="small")
    ax.set(xlabel="Re s / (1/s)", ylabel="Im s / (rad/s)")


def plot_stability_map(ax: Axes, chart: StabilityMap, chosen: Mapping[str, float] | None) -> None:
    """Spectral abscissa where the loop is stable, its boundary, and the chosen gains."""
    across, up = chart.names
    x, y = chart.axes[across], chart.axes[up]
    shading = np.where(chart.stable, chart.abscissa, np.nan).T
    if np.any(np.isfinite(shading)):
        drawn = ax.pcolormesh(x, y, shading, cmap="viridis_r", shading="auto", rasterized=True)
        ax.figure.colorbar(drawn, ax=ax, label="spectral abscissa / (1/s)")
    if 0.0 < chart.stable.mean() < 1.0:
        # The abscissa is continuous, so its zero line lies between the cells it separates. Where
        # it is missing or infinite, the boundary goes by the cells themselves.
        whole = np.all(np.isfinite(chart.abscissa))
        level = chart.abscissa if whole else 0.5 - chart.stable.astype(float)
        ax.contour(x, y, level.T, levels=[0.0], colors="k", linewidths=1.2)
    if chosen:
        ax.plot(chosen[across], chosen[up], "*", color=COLOURS[1], ms=14, mec="w")
    ax.set(xlabel=across, ylabel=up, xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
