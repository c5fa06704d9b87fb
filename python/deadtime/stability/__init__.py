"""Stability over ranges of gains and delays: maps, proved boxes, robust maps, stability radius.

`stability_map` counts unstable roots over two numbers, and `tiles` divides maps that are too large
for one call. `proved_boxes`, `largest_stable_box`, `robust_map` and `stability_radius` prove what
holds for whole ranges.
"""

# The files. `_map` is `stability_map`, `_boundaries` its crossing curves; `_boxes`, `_robust` and
# `_radius` prove what holds for whole ranges; `_tiles` divides maps too large for one call.
# `_arguments` reads axes and intervals.

from deadtime.stability._boxes import ProvedBoxes, largest_stable_box, proved_boxes
from deadtime.stability._map import MapStatus, StabilityMap, stability_map
from deadtime.stability._radius import StabilityRadius, stability_radius
from deadtime.stability._robust import RobustMap, robust_map
from deadtime.stability._tiles import Tile, Tiles, tiles

__all__ = [
    "MapStatus",
    "ProvedBoxes",
    "RobustMap",
    "StabilityMap",
    "StabilityRadius",
    "Tile",
    "Tiles",
    "largest_stable_box",
    "proved_boxes",
    "robust_map",
    "stability_map",
    "stability_radius",
    "tiles",
]
