"""Set points as messages: SET_POSITION_TARGET_LOCAL_NED and SET_ATTITUDE_TARGET.

Their masks name what is not followed. ArduPilot and PX4 read them alike; thrust is the collective
thrust from 0 to 1 in both once ArduPilot has been told so (`Autopilot.allow`).
"""

from __future__ import annotations

import math
from typing import Any

from deadtime.links.mavlink.codec import dialect
from deadtime.links.mavlink.points import Attitude, BodyRates, Place, Point

#: Velocities are followed; positions and accelerations are not given, nor the heading. Without the
#: last bit a rate of turn is.
VELOCITY_ONLY, NO_TURN = 0x05C7, 0x0800

#: Position and heading are followed; velocity, acceleration and rate of turn are not given.
POSITION_AND_HEADING = 0x09F8

#: The attitude without rates, and the rates without attitude.
NO_RATES, NO_ATTITUDE = 0x07, 0x80

#: Frame of positions and velocities: north, east, down.
LOCAL_NED = 1


def message_of(point: Point, target: tuple[int, int], now: float, ground: float) -> Any:
    """A set point as a message.

    Parameters
    ----------
    point : Motion, Place, Attitude or BodyRates
    target : (int, int)
        System and component of the vehicle.
    now : float
        s.
    ground : float
        Down coordinate of the ground, m, from which heights count.
    """
    time, zero = round(1e3 * now) % 2**32, 0.0
    if isinstance(point, (Attitude, BodyRates)):
        return _attitude_target(point, target, time)
    if isinstance(point, Place):
        down = ground - point.height
        mask = POSITION_AND_HEADING
        numbers = (point.north, point.east, down, *[zero] * 6, point.heading, zero)
    else:
        mask, turn = VELOCITY_ONLY, point.turn
        if turn is None:
            mask, turn = mask | NO_TURN, zero
        speeds = (point.north, point.east, -point.up)
        numbers = (zero, zero, zero, *speeds, *[zero] * 4, turn)
    return dialect().MAVLink_set_position_target_local_ned_message(
        time, *target, LOCAL_NED, mask, *numbers
    )


def _attitude_target(point: Attitude | BodyRates, target: tuple[int, int], time: int) -> Any:
    mask, rates, turned = NO_RATES, (0.0, 0.0, 0.0), [1.0, 0.0, 0.0, 0.0]
    if isinstance(point, Attitude):
        turned = quaternion(point.roll, point.pitch, point.heading)
    else:
        mask, rates = NO_ATTITUDE, (point.roll, point.pitch, point.turn)
    return dialect().MAVLink_set_attitude_target_message(
        time, *target, mask, turned, *rates, point.thrust
    )


def quaternion(roll: float, pitch: float, heading: float) -> list[float]:
    """The rotation from north-east-down: heading, then pitch, then roll; w, x, y, z."""
    (cr, sr), (cp, sp), (ch, sh) = (
        (math.cos(0.5 * angle), math.sin(0.5 * angle)) for angle in (roll, pitch, heading)
    )
    return [
        cr * cp * ch + sr * sp * sh,
        sr * cp * ch - cr * sp * sh,
        cr * sp * ch + sr * cp * sh,
        cr * cp * sh - sr * sp * ch,
    ]
