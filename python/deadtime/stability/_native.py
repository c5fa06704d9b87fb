"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    MapBoundary as MapBoundary,
    largest_stable_box as largest_stable_box,
    proved_boxes as proved_boxes,
    robust_map as robust_map,
    stability_radius as stability_radius,
)
