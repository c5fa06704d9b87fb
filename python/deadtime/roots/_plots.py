"""Drawings of characteristic roots. Matplotlib is imported when something is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from deadtime._base.drawing import COLOURS, Axes
from deadtime.roots._chains import Chain
from deadtime.roots._root_set import RootSet

CHAIN: dict[str, Any] = {"color": "#d1481f", "lw": 1.0, "ls": "--", "zorder": 3}


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
