"""Loops in the MAVLink messages of a tlog."""

from __future__ import annotations

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime.logs._ardupilot_modes import (
    HORIZONTAL as ARDUPILOT_HORIZONTAL,
    UNCONTROLLED,
    VERTICAL as ARDUPILOT_VERTICAL,
)
from deadtime.logs._conditions import closed_where, in_modes, in_the_air, not_in_modes, state
from deadtime.logs._names import Condition, LoopNames, Signal
from deadtime.logs._px4_modes import HORIZONTAL as PX4_HORIZONTAL, VERTICAL as PX4_VERTICAL
from deadtime.logs._rotations import pitch_of, roll_of, unwrapped, yaw_of

#: Bit of ``HEARTBEAT.base_mode``.
ARMED = 128

#: ``EXTENDED_SYS_STATE.landed_state``.
ON_GROUND = 1

FLYING = (
    Condition(
        state("HEARTBEAT", "base_mode", lambda values: values.astype(np.int64) & ARMED != 0),
        "the vehicle is disarmed",
    ),
    Condition(
        in_the_air("EXTENDED_SYS_STATE", "landed_state", lambda values: values != ON_GROUND),
        "the vehicle is on the ground or lands",
    ),
)
ATTITUDE = (*FLYING, closed_where(not_in_modes(UNCONTROLLED)))
HORIZONTAL = (*FLYING, closed_where(in_modes(ARDUPILOT_HORIZONTAL | PX4_HORIZONTAL)))
VERTICAL = (*FLYING, closed_where(in_modes(ARDUPILOT_VERTICAL | PX4_VERTICAL)))

QUATERNION = ("q[0]", "q[1]", "q[2]", "q[3]")
DOWN = "downwards to upwards"


def _used(bit: int, values: Array, mask: Array) -> Array:
    """The values, NaN where the mask says that they are ignored."""
    ignored: Mask = np.nan_to_num(mask).astype(np.int64) >> bit & 1 != 0
    return np.where(ignored, np.nan, values)


def _asked(column: str, bit: int, unit: str, sign: float, rule: str) -> tuple[Signal, ...]:
    """What the vehicle says it follows, else what the ground station sent."""
    return tuple(
        Signal(
            topic, (column, "type_mask"), unit, sign,
            derive=lambda values, mask: _used(bit, values, mask),
            rule=rule,
        )
        for topic in ("POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_LOCAL_NED")
    )  # fmt: skip


def _inner_loops() -> list[LoopNames]:
    rates, angles = [], []
    for axis, derive in (("roll", roll_of), ("pitch", pitch_of), ("yaw", yaw_of)):
        asked = Signal("ATTITUDE_TARGET", (f"body_{axis}_rate",), "rad/s")
        rates.append(
            LoopNames(
                f"{axis} rate", axis, "rate", (asked,),
                (Signal("ATTITUDE", (f"{axis}speed",), "rad/s"),), conditions=ATTITUDE,
            )
        )  # fmt: skip
        rule = f"{axis} of the quaternion"
        setpoint = [Signal("ATTITUDE_TARGET", QUATERNION, "rad", derive=derive, rule=rule)]
        if axis != "yaw":
            setpoint.append(Signal("NAV_CONTROLLER_OUTPUT", (f"nav_{axis}",), "deg"))
        whole = unwrapped if axis == "yaw" else None
        rule = "without jumps of a full turn" if axis == "yaw" else ""
        response = Signal("ATTITUDE", (axis,), "rad", derive=whole, rule=rule)
        angles.append(LoopNames(axis, axis, "attitude", setpoint, (response,), (asked,), ATTITUDE))
    return [*rates, *angles]


def _translations() -> list[LoopNames]:
    loops = []
    for k, (axis, letter) in enumerate((("north", "x"), ("east", "y"), ("vertical", "z"))):
        upwards = axis == "vertical"
        sign, rule = (-1.0, DOWN) if upwards else (1.0, "")
        speed = _asked(f"v{letter}", 3 + k, "m/s", sign, rule)
        moving = [
            Signal("LOCAL_POSITION_NED", (f"v{letter}",), "m/s", sign, rule=rule),
            Signal("GLOBAL_POSITION_INT", (f"v{letter}",), "cm/s", sign, rule=rule),
        ]
        place = [Signal("LOCAL_POSITION_NED", (letter,), "m", sign, rule=rule)]
        if upwards:
            moving.append(Signal("VFR_HUD", ("climb",), "m/s"))
            place.append(Signal("GLOBAL_POSITION_INT", ("relative_alt",), "mm"))
        conditions = VERTICAL if upwards else HORIZONTAL
        loops += [
            LoopNames(
                "vertical speed" if upwards else f"{axis} velocity", axis, "velocity",
                speed, moving, conditions=conditions,
            ),
            LoopNames(
                "altitude" if upwards else f"{axis} position", axis, "position",
                _asked(letter, k, "m", sign, rule), place, speed, conditions,
            ),
        ]  # fmt: skip
    return loops


LOOPS = (*_inner_loops(), *_translations())
