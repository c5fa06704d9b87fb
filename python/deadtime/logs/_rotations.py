"""Roll, pitch and yaw of unit quaternions (w, x, y, z), rad."""

from __future__ import annotations

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs._names import Signal

#: Least sum of squares of a quaternion, which is 1 to rounding; firmware logs zeros for one that is
#: not set.
SET = 0.5


def _where_set(angle: Array, w: Array, x: Array, y: Array, z: Array) -> Array:
    return np.where(w * w + x * x + y * y + z * z >= SET, angle, np.nan)


def roll_of(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Rotation about the forward axis."""
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return _where_set(roll, w, x, y, z)


def pitch_of(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Rotation about the right axis, nose up."""
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return _where_set(pitch, w, x, y, z)


def yaw_of(w: Array, x: Array, y: Array, z: Array) -> Array:
    """Rotation about the downward axis, in one turn after another: it does not jump at pi."""
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return unwrapped(_where_set(yaw, w, x, y, z))


def heading(topic: str, column: str) -> Signal:
    """A yaw that is logged in degrees and jumps by a turn."""
    return Signal(
        topic, (column,), "rad",
        derive=lambda degrees: unwrapped(degrees * (np.pi / 180.0)),
        rule="[deg] to rad without jumps of a full turn",
    )  # fmt: skip


def unwrapped(angle: Array) -> Array:
    """The angle without jumps of a turn; rows that are not finite stay so."""
    finite = np.isfinite(angle)
    found = np.full_like(angle, np.nan)
    found[finite] = np.unwrap(angle[finite])
    return found
