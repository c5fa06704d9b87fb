"""Roll, pitch and yaw of unit quaternions (w, x, y, z), rad."""

from __future__ import annotations

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs._names import Signal


def roll_of(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Rotation about the forward axis."""
    return np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))


def pitch_of(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Rotation about the right axis, nose up."""
    return np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))


def yaw_of(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Rotation about the downward axis, in one turn after another: it does not jump at pi."""
    return unwrapped(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def heading(topic: str, column: str) -> Signal:
    """A yaw that is logged in degrees and jumps by a turn."""
    return Signal(
        topic, (column,), "rad",
        derive=lambda degrees: unwrapped(degrees * (np.pi / 180.0)),
        rule="[deg] to rad without jumps of a turn",
    )  # fmt: skip


def unwrapped(angle: Array) -> Array:
    """The angle without jumps of a turn; rows that are not finite stay so."""
    finite = np.isfinite(angle)
    found = np.full_like(angle, np.nan)
    found[finite] = np.unwrap(angle[finite])
    return found
