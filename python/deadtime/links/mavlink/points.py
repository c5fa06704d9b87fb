"""What a vehicle may be told to follow beside a velocity, within the limits of its flight."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, TypeAlias, TypeVar

from deadtime._base.validation import finite
from deadtime.links.safety import Limits
from deadtime.links.vehicle import Motion, VehicleState

#: Kinds of set points that have to be allowed before they are commanded.
Kind: TypeAlias = Literal["position", "attitude", "rates"]


class Place(NamedTuple):
    """A position, m: north and east as the vehicle reports them, the height; a heading, rad."""

    north: float
    east: float
    height: float
    heading: float


class Attitude(NamedTuple):
    """Roll (right), pitch (nose up) and heading, rad, and a share of the largest thrust."""

    roll: float
    pitch: float
    heading: float
    thrust: float


class BodyRates(NamedTuple):
    """Rates around the axes of the vehicle (forward, right, down), rad/s, and a share of thrust."""

    roll: float
    pitch: float
    turn: float
    thrust: float


Point: TypeAlias = Motion | Place | Attitude | BodyRates

#: Numbers whose squares are finite.
HUGE = 1e150

P = TypeVar("P", Place, Attitude, BodyRates)


def _checked(point: P) -> P:
    for name, value in point._asdict().items():
        finite(name, value)
    return point


def _reported(name: str, value: float | None) -> float:
    """A number of a state; 0 where the vehicle reports none."""
    return 0.0 if value is None else finite(f"{name} of the vehicle", value)


def _between(low: float, value: float, high: float) -> float:
    return max(low, min(high, value))


def _shortened(x: float, y: float, most: float) -> tuple[float, float]:
    """The vector, no longer than this, in its direction."""
    x, y = _between(-HUGE, x, HUGE), _between(-HUGE, y, HUGE)
    share = min(1.0, most / max(math.hypot(x, y), 1e-300))
    return share * x, share * y


def place_within(place: Place, origin: VehicleState, limits: Limits) -> Place:
    """The nearest place within the heights, and the distance from where it took off.

    Raises
    ------
    ValueError
        If a number is not finite, also of where it took off.
    """
    north, east, height, heading = _checked(place)
    at = _reported("north", origin.north), _reported("east", origin.east)
    away = _shortened(north - at[0], east - at[1], limits.max_distance)
    return Place(
        at[0] + away[0],
        at[1] + away[1],
        _between(limits.min_height, height, limits.max_height),
        math.remainder(heading, 2.0 * math.pi),
    )


def attitude_within(attitude: Attitude, limits: Limits) -> Attitude:
    """The attitude with less tilt, in its direction, and a thrust that is allowed.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    roll, pitch, heading, thrust = _checked(attitude)
    return Attitude(
        *_shortened(roll, pitch, limits.max_angle),
        math.remainder(heading, 2.0 * math.pi),
        _between(limits.min_thrust, thrust, limits.max_thrust),
    )


def rates_within(rates: BodyRates, state: VehicleState, limits: Limits) -> BodyRates:
    """Rates at which the tilt stays within its limit while the command is valid.

    Roll and pitch together are no faster than ``limits.max_body_rate``. A tilt beyond the limit is
    brought back.

    Raises
    ------
    ValueError
        If a number is not finite, also of the tilt.
    """
    roll, pitch, turn, thrust = _checked(rates)
    tilt = _reported("roll", state.roll), _reported("pitch", state.pitch)
    most, age = limits.max_body_rate, limits.command_age
    roll, pitch = _shortened(roll, pitch, most)
    aim = _shortened(tilt[0] + age * roll, tilt[1] + age * pitch, limits.max_angle)
    roll, pitch = _shortened((aim[0] - tilt[0]) / age, (aim[1] - tilt[1]) / age, most)
    return BodyRates(
        roll,
        pitch,
        _between(-min(most, limits.max_yaw_rate), turn, min(most, limits.max_yaw_rate)),
        _between(limits.min_thrust, thrust, limits.max_thrust),
    )
