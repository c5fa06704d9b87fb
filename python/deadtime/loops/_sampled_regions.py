"""Poles of a sampled loop in a region of the s-plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deadtime._base.errors import ContourError
from deadtime._base.validation import OpenRange, open_interval
from deadtime.loops._stability import sampled_roots
from deadtime.roots import RootSet


def sampled_poles_in(
    matrix: NDArray[np.float64], sample_time: float, re: OpenRange | None, im: OpenRange | None
) -> RootSet:
    """Return the poles s = ln(z)/sample_time of a transition matrix in a region.

    Poles at z = 0 are in no region. Real poles belong to a region whose edge is the real axis.

    Raises
    ------
    ContourError
        If rounding may put a pole on either side of the edge.
    ValueError
        If a range is not increasing.
    """
    every = sampled_roots(matrix, sample_time, len(matrix))
    region = open_interval("re", re), open_interval("im", im)
    for name, (low, high) in zip(("re", "im"), region, strict=True):
        if not low < high:
            raise ValueError(f"{name}=({low:g}, {high:g}): give (low, high) with low < high")
    # An error e of z moves s by ln(1 + e/z)/sample_time.
    error = np.nan_to_num(every.radii * sample_time, nan=0.0)
    with np.errstate(divide="ignore"):
        shrunk = np.log1p(-np.minimum(error, 1.0)) / sample_time
    grown = np.log1p(error) / sample_time
    turned = np.where(error < 1.0, np.arcsin(np.minimum(error, 1.0)), np.pi) / sample_time
    x, y = every.roots.real, every.roots.imag
    is_real = y == 0.0
    turned[is_real] = 0.0
    (left, right), (bottom, top) = region
    inside = (x + shrunk > left) & (x + grown < right)
    inside &= np.where(is_real, (bottom <= 0.0) & (top >= 0.0), (y - turned > bottom))
    inside &= is_real | (y + turned < top)
    possible = (x + grown >= left) & (x + shrunk <= right)
    possible &= (y + turned >= bottom) & (y - turned <= top)
    inside &= possible
    unclear = np.flatnonzero(possible & ~inside)
    if unclear.size:
        discs = [(complex(every.roots[i]), float(every.radii[i]), 1) for i in unclear]
        pole, radius, _ = discs[0]
        raise ContourError(
            f"a pole at {pole:.6g} 1/s, known to {radius:.1e}, lies on the edge of the region or "
            "too close to it to tell the side: move the edge",
            pole,
            2.0 * radius,
            int(np.count_nonzero(inside)),
            discs,
        )
    return RootSet(
        every.roots[inside],
        every.multiplicities[inside],
        every.radii[inside],
        every.resolved[inside],
        int(np.count_nonzero(inside)),
        region,
    )
