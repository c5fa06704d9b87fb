"""Draw the block diagrams of the page on the reproduced paper: ``python docs/diagrams.py``.

A diagram consists of blocks and circles at given points, and of arrows through given points.
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Rectangle

IMAGES = Path(__file__).parent / "images"

LINE = "#0b6fb8"
Point = tuple[float, float]


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure without a frame, whose axes are in tenths of an inch (approximately)."""
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(0, 10 * width), ylim=(0, 10 * height), aspect="equal")
    axes.axis("off")
    return figure, axes


def block(axes: Axes, at: Point, text: str, width: float = 12.0, height: float = 7.0) -> None:
    """A block with a text in it, centred at a point."""
    corner = (at[0] - width / 2, at[1] - height / 2)
    axes.add_patch(
        FancyBboxPatch(
            corner, width, height, boxstyle="round,pad=0,rounding_size=0.8", fc="#eef4fa", ec=LINE
        )
    )
    axes.text(*at, text, ha="center", va="center", fontsize=10)


def difference(axes: Axes, at: Point) -> None:
    """A circle at which the signal from below is subtracted from that from the left."""
    axes.add_patch(Circle(at, 1.6, fc="white", ec=LINE))
    axes.text(at[0] - 3.0, at[1] + 1.4, "+", fontsize=10)
    axes.text(at[0] + 0.9, at[1] - 4.0, "−", fontsize=11)


def arrow(axes: Axes, points: Sequence[Point], text: str = "", dashed: bool = False) -> None:
    """An arrow through points, with its text above the middle of the first line."""
    style = "--" if dashed else "-"
    until = points[:-1]
    axes.plot([x for x, _ in until], [y for _, y in until], color="0.25", lw=1.1, ls=style)
    axes.add_patch(
        FancyArrowPatch(
            points[-2],
            points[-1],
            arrowstyle="-|>",
            mutation_scale=11,
            color="0.25",
            lw=1.1,
            ls=style,
            shrinkA=0,
            shrinkB=0,
        )
    )
    if text:
        (x0, y0), (x1, y1) = points[0], points[1]
        axes.text((x0 + x1) / 2, (y0 + y1) / 2 + 1.0, text, ha="center", fontsize=9)


def frame(axes: Axes, corner: Point, width: float, height: float, text: str) -> None:
    """A dotted frame around the parts that run on one computer."""
    axes.add_patch(Rectangle(corner, width, height, fill=False, ec="0.6", ls=":"))
    axes.text(corner[0] + 1.0, corner[1] + height - 2.6, text, fontsize=9, color="0.4")


def internet_loop() -> Figure:
    """Figure 1: controller and plant on two computers."""
    figure, axes = canvas(7.6, 3.0)
    frame(axes, (8, 13), 25, 15, "computer A: controller")
    frame(axes, (47, 13), 22, 15, "computer B: plant")
    arrow(axes, [(1, 20), (11.4, 20)], "r")
    difference(axes, (13, 20))
    block(axes, (24, 20), "K")
    block(axes, (58, 20), r"$\dot z = w$")
    arrow(axes, [(14.6, 20), (18, 20)])
    arrow(axes, [(30, 20), (52, 20)], "UDP", dashed=True)
    arrow(axes, [(64, 20), (75, 20)], "z")
    arrow(axes, [(72, 20), (72, 5), (13, 5), (13, 18.4)], dashed=True)
    axes.text(41, 6, "UDP", ha="center", fontsize=9)
    axes.text(41, 1.4, "round trip Td, over the Internet", ha="center", fontsize=9, color="0.4")
    return figure


def proportional_loop() -> Figure:
    """Figure 4: the altitude loop under proportional control."""
    figure, axes = canvas(7.6, 2.6)
    arrow(axes, [(1, 18), (8.4, 18)], "r")
    difference(axes, (10, 18))
    block(axes, (21, 18), "Kp", width=10)
    block(axes, (38, 18), "limit\n± 1 m/s", width=14)
    block(axes, (58, 18), r"$1/s$", width=10)
    block(axes, (41, 5.5), r"delay $e^{-s\,T_d}$", width=18)
    arrow(axes, [(11.6, 18), (16, 18)])
    arrow(axes, [(26, 18), (31, 18)], "u")
    arrow(axes, [(45, 18), (53, 18)], "w")
    arrow(axes, [(63, 18), (75, 18)], "z")
    arrow(axes, [(70, 18), (70, 5.5), (50, 5.5)])
    arrow(axes, [(32, 5.5), (10, 5.5), (10, 16.4)])
    return figure


def velocity_loop() -> Figure:
    """Figure 5: the altitude loop under proportional-plus-velocity control, with the filter."""
    figure, axes = canvas(8.6, 3.6)
    arrow(axes, [(1, 28), (8.4, 28)], "r")
    difference(axes, (10, 28))
    block(axes, (20, 28), "Kp", width=9)
    difference(axes, (31, 28))
    block(axes, (44, 28), "limit\n± 1 m/s", width=14)
    block(axes, (63, 28), r"$1/s$", width=10)
    block(axes, (67, 5.5), r"delay $e^{-s\,T_d}$", width=17)
    block(
        axes,
        (45, 15.5),
        r"$\dfrac{\omega_f^2\,s}{s^2+2\zeta_f\omega_f s+\omega_f^2}$",
        width=19,
        height=9,
    )
    block(axes, (31, 15.5), "Kv", width=6)
    arrow(axes, [(11.6, 28), (15.5, 28)])
    arrow(axes, [(24.5, 28), (29.4, 28)])
    arrow(axes, [(32.6, 28), (37, 28)], "u")
    arrow(axes, [(51, 28), (58, 28)], "w")
    arrow(axes, [(68, 28), (85, 28)], "z")
    arrow(axes, [(80, 28), (80, 5.5), (75.5, 5.5)])
    arrow(axes, [(58.5, 5.5), (10, 5.5), (10, 26.4)])
    arrow(axes, [(57.2, 5.5), (57.2, 15.5), (54.5, 15.5)])
    arrow(axes, [(35.5, 15.5), (34, 15.5)])
    arrow(axes, [(31, 19), (31, 26.4)])
    return figure


if __name__ == "__main__":
    mpl.rcParams["svg.hashsalt"] = "deadtime"
    for number, figure in ((1, internet_loop()), (4, proportional_loop()), (5, velocity_loop())):
        figure.savefig(IMAGES / f"paper-figure{number}.svg", metadata={"Date": None})
