"""Sentences of the commands about the stability of a loop and about lists of roots."""

from __future__ import annotations

import math

from deadtime.loops import ControlLoop
from deadtime.roots import RootSet


def verdict(loop: ControlLoop) -> str:
    """Stable; unstable, with the root or chain of roots that proves it; or neither is proved."""
    abscissa = loop.spectral_abscissa()
    if loop.is_stable():
        return f"stable: spectral abscissa {abscissa:.6g} 1/s"
    rightmost = loop.rightmost()
    for root, radius in zip(rightmost.roots.tolist(), rightmost.radii.tolist(), strict=True):
        if root.real > radius:
            imaginary = f" ± {abs(root.imag):.6g}j" if root.imag else ""
            return (
                f"unstable: a root at {root.real:.6g}{imaginary} grows by a factor e in "
                f"{1.0 / root.real:.3g} s"
            )
    chain = -math.inf if loop.is_sampled else loop.characteristic().chain_abscissa()
    if chain > 0.0:
        return f"unstable: a chain of roots approaches Re s = {chain:.6g} 1/s"
    return (
        f"not proved stable: spectral abscissa {abscissa:.6g} 1/s. A root is on the imaginary "
        "axis, or too close to the axis for a proof"
    )


def listed(found: RootSet, requested: int | None, chain: float) -> str:
    """Number of roots in a list and the region in which these are all roots.

    `requested` is the number of rightmost roots asked for, None for the roots of a region.
    """
    number = f"{found.counted} {'root' if found.counted == 1 else 'roots'}"
    (low, high), (bottom, top) = found.region
    if requested is None:
        return (
            f"{number} in re=({low:g}, {high:g}), im=({bottom:g}, {top:g}). The list is "
            "proved to be complete"
        )
    upper = sum(1 for root in found.roots.tolist() if root.imag >= 0.0)
    if not math.isfinite(low):
        return f"{number}. The list is proved to be complete"
    if upper >= requested:
        return f"{number}. The list is proved to be complete right of Re s = {low:.6g}"
    if math.isfinite(chain):
        return (
            f"{number} instead of the {requested} that were asked for. The list is proved to be "
            f"complete right of Re s = {low:.6g}. The next roots belong to the chain"
        )
    return (
        f"{number} instead of the {requested} that were asked for. The list is proved to be "
        f"complete right of Re s = {low:.6g}"
    )
