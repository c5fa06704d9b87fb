"""Drawing of maps and proved boxes; matplotlib is imported when something is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from deadtime._base.drawing import COLOURS, Axes

if TYPE_CHECKING:
    from deadtime.stability._boundaries import Boundary
    from deadtime.stability._boxes import ProvedBoxes
    from deadtime.stability._map import StabilityMap
    from deadtime.stability._robust import RobustMap

#: Colours for one, two, ... unstable roots; more share the last one.
_COUNTED = 8

#: Number of points, as a share of the shorter side of the map, below which a curve has no label.
_LABELLED = 0.15

#: Largest number of labels of one picture.
_MOST_LABELS = 8

#: Stable, unstable, infinitely many unstable roots, undecided.
KINDS = ("#7fbf7b", "#f2d3c2", "#c9b3cf", "#3a3a3a")
LABELS = ("stable", "unstable", "infinitely many unstable roots", "undecided")


def plot_stability_map(
    ax: Axes, chart: StabilityMap, chosen: Mapping[str, float] | None, show: str
) -> None:
    """Shade the cells, draw the boundaries with their frequencies, mark the chosen point."""
    across, up = chart.names
    x, y = chart.axes[across], chart.axes[up]
    (_shade_abscissa if show == "abscissa" else _shade_counts)(ax, chart)
    _draw_boundaries(ax, chart)
    if chosen:
        ax.plot(chosen[across], chosen[up], "*", color=COLOURS[1], ms=14, mec="w", zorder=4)
    ax.set(xlabel=across, ylabel=up, xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))


def _shade_abscissa(ax: Axes, chart: StabilityMap) -> None:
    """Spectral abscissa where the loop is stable."""
    shading = np.where(chart.stable, chart.abscissa, np.nan).T
    if np.any(np.isfinite(shading)):
        drawn = ax.pcolormesh(
            *chart.axes.values(), shading, cmap="viridis_r", shading="auto", rasterized=True
        )
        ax.figure.colorbar(drawn, ax=ax, label="spectral abscissa / (1/s)")


def _shade_counts(ax: Axes, chart: StabilityMap) -> None:
    """Number of unstable roots: green for none, grey for infinitely many."""
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm, ListedColormap

    counts = chart.unstable.astype(float)
    counts[counts == -1.0] = _COUNTED + 1.0
    counts[counts == -2.0] = np.nan
    counts = np.where((counts > _COUNTED) & (chart.unstable > 0), float(_COUNTED), counts)
    steps = colormaps["Blues"](np.linspace(0.15, 0.95, _COUNTED))
    colours = ListedColormap([(0.86, 0.95, 0.86, 1.0), *steps, (0.45, 0.45, 0.45, 1.0)])
    norm = BoundaryNorm(np.arange(-0.5, _COUNTED + 2.0), colours.N)
    x, y = chart.axes.values()
    drawn = ax.pcolormesh(
        x, y, counts.T, cmap=colours, norm=norm, shading="nearest", rasterized=True
    )
    bar = ax.figure.colorbar(drawn, ax=ax, label="unstable roots", ticks=range(_COUNTED + 2))
    bar.ax.set_yticklabels([*map(str, range(_COUNTED)), f"{_COUNTED}+", "no end"])


def _draw_boundaries(ax: Axes, chart: StabilityMap) -> None:
    """Crossing curves where they are known, else the edge of the stable cells."""
    try:
        curves = chart.boundaries
    except ValueError:
        curves = ()
    for curve in curves:
        ax.plot(*(curve.values[name] for name in chart.names), color="k", lw=1.0, zorder=3)
    x, y = chart.axes.values()
    least = _LABELLED * min(len(x), len(y))
    for curve in [curve for curve in curves if len(curve) >= least][:_MOST_LABELS]:
        _label(ax, chart, curve)
    # Cells with finitely many unstable roots: chains end them where no curve does.
    edges = chart.unstable != -1 if curves else chart.stable
    if 0.0 < edges.mean() < 1.0:
        # The abscissa is continuous, so its zero line lies between the cells it separates. Where
        # it is missing or infinite, the boundary goes by the cells themselves.
        whole = not curves and np.all(np.isfinite(chart.abscissa))
        level = chart.abscissa if whole else 0.5 - edges.astype(float)
        ax.contour(
            x, y, level.T, levels=[-chart.decay if whole else 0.0], colors="k", linewidths=1.2
        )


def _label(ax: Axes, chart: StabilityMap, curve: Boundary) -> None:
    """Write the frequencies of a curve beside it, in the middle of its course."""
    across, up = chart.names
    high = float(curve.omega.max())
    middle = len(curve) // 2
    text = "ω = 0" if high == 0.0 else f"ω = {curve.omega[middle]:.3g}"
    ax.annotate(
        text,
        (float(curve.values[across][middle]), float(curve.values[up][middle])),
        textcoords="offset points",
        xytext=(4, 4),
        fontsize="x-small",
        color="0.15",
        bbox={"boxstyle": "round,pad=0.1", "fc": "w", "ec": "none", "alpha": 0.7},
        zorder=5,
    )


def _kinds(unstable: NDArray[np.int32]) -> NDArray[np.int64]:
    """Index of the colour of each count."""
    return np.select([unstable == 0, unstable > 0, unstable == -1], [0, 1, 2], 3)


def _legend(ax: Axes, kinds: NDArray[np.int64], labels: tuple[str, ...]) -> None:
    from matplotlib.patches import Patch

    shown = [
        Patch(facecolor=KINDS[kind], edgecolor="0.4", label=labels[kind])
        for kind in np.unique(kinds)
    ]
    ax.legend(
        handles=shown,
        fontsize="small",
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(shown),
        frameon=False,
        borderaxespad=0.2,
    )


def plot_boxes(ax: Axes, boxes: ProvedBoxes) -> Axes:
    """Every box in the colour of what is proved of it."""
    from matplotlib.collections import PolyCollection

    moving = [i for i, name in enumerate(boxes.names) if np.diff(boxes.ranges[name])[0] > 0.0]
    if len(moving) != 2:
        raise ValueError(
            f"the boxes have {len(moving)} parameters, but a picture shows two: give each other "
            "parameter a value"
        )
    across, up = moving
    left, right = boxes.low[:, across], boxes.high[:, across]
    low, high = boxes.low[:, up], boxes.high[:, up]
    corners = np.stack(
        [
            np.column_stack([left, low]),
            np.column_stack([right, low]),
            np.column_stack([right, high]),
            np.column_stack([left, high]),
        ],
        axis=1,
    )
    kinds = _kinds(boxes.unstable)
    colours = np.array(KINDS)[kinds]
    # Edges would cover small boxes.
    edges: Any = "face" if len(kinds) > 3000 else "0.5"
    ax.add_collection(
        PolyCollection(
            list(corners), facecolors=list(colours), edgecolors=edges, lw=0.25, rasterized=True
        )
    )
    _legend(ax, kinds, LABELS)
    x, y = boxes.names[across], boxes.names[up]
    ax.set(xlabel=x, ylabel=y, xlim=boxes.ranges[x], ylim=boxes.ranges[y])
    return ax


def plot_robust_map(ax: Axes, chart: RobustMap) -> Axes:
    """Every cell in the colour of what is proved of it."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    x, y = chart.names
    kinds = _kinds(chart.unstable)
    ax.pcolormesh(
        chart.axes[x],
        chart.axes[y],
        kinds.T,
        cmap=ListedColormap(list(KINDS)),
        norm=BoundaryNorm(np.arange(5) - 0.5, 4),
        shading="nearest",
        rasterized=True,
    )
    labels = ("stable throughout", "unstable somewhere", *LABELS[2:])
    _legend(ax, kinds, labels)
    held = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, (low, high) in chart.over.items())
    ax.set(xlabel=x, ylabel=y)
    ax.set_title(f"for all {held}", loc="left", fontsize="small")
    return ax
