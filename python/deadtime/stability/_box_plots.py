"""Drawing of proved boxes and robust maps; matplotlib is imported when something is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from deadtime._base.drawing import shown_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from deadtime.stability._boxes import ProvedBoxes
    from deadtime.stability._robust import RobustMap

__all__ = ["plot_boxes", "plot_robust_map", "shown_axes"]

#: Stable, unstable, infinitely many unstable roots, undecided.
COLOURS = ("#7fbf7b", "#f2d3c2", "#c9b3cf", "#3a3a3a")
LABELS = ("stable", "unstable", "infinitely many unstable roots", "undecided")


def _kinds(unstable: NDArray[np.int32]) -> NDArray[np.int64]:
    """Index of the colour of each count."""
    return np.select([unstable == 0, unstable > 0, unstable == -1], [0, 1, 2], 3)


def _legend(ax: Axes, kinds: NDArray[np.int64], labels: tuple[str, ...]) -> None:
    from matplotlib.patches import Patch

    shown = [
        Patch(facecolor=COLOURS[kind], edgecolor="0.4", label=labels[kind])
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
            f"boxes of {len(moving)} parameters: a picture has two; give the others values"
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
    colours = np.array(COLOURS)[kinds]
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
        cmap=ListedColormap(list(COLOURS)),
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
