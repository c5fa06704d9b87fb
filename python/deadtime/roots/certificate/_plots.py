"""Plots of certificates; matplotlib is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from deadtime.roots.certificate._certificate import Certificate

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_certificate(ax: Axes, proof: Certificate) -> None:
    """Draw the segments of a certificate, coloured by the argument of the function.

    The values in a certificate contain a factor exp(s tau), which is removed here, so that the
    colours pass through their cycle once for every root inside.
    """
    from matplotlib.collections import LineCollection

    for contour in proof.contours:
        for mirrored in (False, True) if contour.symmetric else (False,):
            sign = -1.0 if mirrored else 1.0
            lines, turns = [], []
            for part in contour.segments:
                lines.append([(z.real, sign * z.imag) for z in (part.start, part.end)])
                turned = proof.delays[part.reference] * part.middle.imag
                turns.append(sign * np.angle(part.value * np.exp(-1j * turned)))
            colours = LineCollection(lines, cmap="twilight", lw=2.5, zorder=2)
            colours.set_array(np.asarray(turns))
            colours.set_clim(-np.pi, np.pi)
            ax.add_collection(colours)
            ends = np.array([line[0] for line in lines])
            ax.plot(ends[:, 0], ends[:, 1], ".", color="0.25", ms=2.5, zorder=3)
    if proof.contours:
        shown = ax.collections[-1]
        bar = ax.figure.colorbar(shown, ax=ax, ticks=[-np.pi, 0.0, np.pi], label="arg h / rad")
        bar.ax.set_yticklabels(["−π", "0", "π"])
    pieces = sum(len(contour.segments) for contour in proof.contours) + len(proof.real)
    plural = "" if proof.count == 1 else "s"
    ax.set(
        xlabel="Re s / (1/s)",
        ylabel="Im s / (rad/s)",
        title=f"{proof.count} root{plural}, proved on {pieces} segments",
    )
    ax.autoscale_view()
