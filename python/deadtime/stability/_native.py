"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    MapBoundary,
    largest_stable_box,
    proved_boxes,
    robust_map,
    stability_radius,
)

__all__ = [
    "MapBoundary",
    "largest_stable_box",
    "proved_boxes",
    "robust_map",
    "stability_radius",
]
