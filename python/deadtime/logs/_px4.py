"""Loops of PX4 in its ULog files."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from deadtime._base.arrays import Array, Mask
from deadtime.logs._conditions import (
    closed_where,
    first_logged,
    in_modes,
    in_the_air,
    not_in_modes,
    state,
)
from deadtime.logs._contents import LogContents
from deadtime.logs._names import AutopilotNames, Condition, Kind, LoopNames, Signal
from deadtime.logs._px4_modes import HORIZONTAL, VERTICAL
from deadtime.logs._rotations import pitch_of, roll_of, unwrapped, yaw_of

AXES = ("roll", "pitch", "yaw")
ANGLES = {"roll": roll_of, "pitch": pitch_of, "yaw": yaw_of}
QUATERNION = ("q[0]", "q[1]", "q[2]", "q[3]")
DEMANDED = ("q_d[0]", "q_d[1]", "q_d[2]", "q_d[3]")

#: The topic of one gyroscope, whose axes are those of the board.
GYRO = "sensor_gyro"

#: ``vehicle_status.arming_state`` of an armed vehicle, in all versions.
ARMED = 2

#: ``takeoff_status.takeoff_state`` while the thrust is raised until the vehicle lifts off.
RAMP_UP = 4


def _is_set(values: Array) -> Mask:
    return values > 0


FLYING = (
    Condition(
        first_logged(
            state("vehicle_status", "arming_state", lambda values: values == ARMED),
            state("actuator_armed", "armed", _is_set),
        ),
        "the vehicle is disarmed",
    ),
    Condition(
        in_the_air("vehicle_land_detected", "landed", lambda values: values == 0),
        "the vehicle is on the ground or lands",
    ),
    Condition(
        state("takeoff_status", "takeoff_state", lambda values: values != RAMP_UP),
        "the thrust is rising for the take-off",
    ),
)


def _closed(flag: str, modes: frozenset[str]) -> tuple[Condition, ...]:
    """Conditions of a loop that some modes close: the flag of the version, else the mode."""
    flagged = state("vehicle_control_mode", f"flag_control_{flag}_enabled", _is_set)
    return (*FLYING, closed_where(first_logged(flagged, in_modes(modes))))


def _rate(axis: str, k: int) -> LoopNames:
    """The rate loop; of old logs without the vehicle's rate, what a gyroscope measures of it."""
    flagged = state("vehicle_control_mode", "flag_control_rates_enabled", _is_set)
    return LoopNames(
        name=f"{axis} rate",
        axis=axis,
        kind="rate",
        setpoint=(Signal("vehicle_rates_setpoint", (axis,), "rad/s"),),
        response=(
            Signal("vehicle_angular_velocity", (f"xyz[{k}]",), "rad/s"),
            Signal("vehicle_attitude", (f"{axis}speed",), "rad/s"),
            Signal("sensor_combined", (f"gyro_rad[{k}]",), "rad/s"),
            Signal(GYRO, ("xyz"[k],), "rad/s"),
        ),
        actuator=(
            Signal("vehicle_torque_setpoint", (f"xyz[{k}]",)),
            Signal("actuator_controls_0", (f"control[{k}]",)),
        ),
        conditions=(*FLYING, closed_where(flagged)),
    )


def _attitude(axis: str) -> LoopNames:
    flagged = state("vehicle_control_mode", "flag_control_attitude_enabled", _is_set)
    derive, rule = ANGLES[axis], f"{axis} of the quaternion"
    turns: dict[str, Any] = {"derive": unwrapped, "rule": "without jumps of a full turn"}
    return LoopNames(
        name=axis,
        axis=axis,
        kind="attitude",
        setpoint=(
            Signal("vehicle_attitude_setpoint", DEMANDED, "rad", derive=derive, rule=rule),
            Signal("vehicle_attitude_setpoint", (f"{axis}_body",), "rad", **turns),
        ),
        response=(
            Signal("vehicle_attitude", QUATERNION, "rad", derive=derive, rule=rule),
            Signal("vehicle_attitude", (axis,), "rad", **turns),
        ),
        actuator=(Signal("vehicle_rates_setpoint", (axis,), "rad/s"),),
        conditions=(*FLYING, closed_where(first_logged(flagged, not_in_modes({"Acro"})))),
    )


def _translation(
    name: str, axis: str, kind: Kind, column: str, planned: str, actuator: tuple[Signal, ...],
) -> LoopNames:  # fmt: skip
    """A velocity or position loop; the log counts down, the vertical loops up."""
    unit = "m/s" if kind == "velocity" else "m"
    sign, rule = (-1.0, "downwards to upwards") if axis == "vertical" else (1.0, "")
    flags = {"velocity": "climb_rate", "position": "altitude"}
    flag = flags[kind] if axis == "vertical" else kind
    return LoopNames(
        name=name,
        axis=axis,
        kind=kind,
        setpoint=(
            Signal("vehicle_local_position_setpoint", (column,), unit, sign, rule=rule),
            Signal("trajectory_setpoint", (planned,), unit, sign, rule=rule),
        ),
        response=(Signal("vehicle_local_position", (column,), unit, sign, rule=rule),),
        actuator=actuator,
        conditions=_closed(flag, VERTICAL if axis == "vertical" else HORIZONTAL),
    )


def _translations() -> list[LoopNames]:
    loops = []
    axes = (("north", "x", 0), ("east", "y", 1), ("vertical", "z", 2))
    for axis, letter, k in axes:
        sign, rule = (-1.0, "downwards to upwards") if axis == "vertical" else (1.0, "")
        topic = "vehicle_local_position_setpoint"
        thrust: tuple[Signal, ...] = (Signal(topic, (f"acceleration[{k}]",), "m/s/s", sign),)
        if axis == "vertical":
            thrust = (
                Signal("vehicle_thrust_setpoint", ("xyz[2]",), "", sign, rule=rule),
                Signal("vehicle_attitude_setpoint", ("thrust_body[2]",), "", sign, rule=rule),
                Signal("vehicle_attitude_setpoint", ("thrust",)),
            )
        speed = "vertical speed" if axis == "vertical" else f"{axis} velocity"
        place = "altitude" if axis == "vertical" else f"{axis} position"
        asked = (Signal(topic, (f"v{letter}",), "m/s", sign, rule=rule),)
        loops += [
            _translation(speed, axis, "velocity", f"v{letter}", f"velocity[{k}]", thrust),
            _translation(place, axis, "position", letter, f"position[{k}]", asked),
        ]
    return loops


NAMES = AutopilotNames(
    loops=(
        *(_rate(axis, k) for k, axis in enumerate(AXES)),
        *map(_attitude, AXES),
        *_translations(),
    ),
    key_parameters=(
        "MC_*RATE_[PIDK]", "MC_*RATE_FF", "MC_ROLL_P", "MC_PITCH_P", "MC_YAW_P", "MC_AIRMODE",
        "MPC_*_P", "MPC_*_ACC", "MPC_XY_*_MAX", "MPC_Z_*_MAX_*", "IMU_GYRO_CUTOFF",
        "IMU_GYRO_NF*", "IMU_GYRO_DNF*", "IMU_GYRO_RATEMAX", "IMU_DGYRO_CUTOFF",
        "MC_DTERM_CUTOFF", "MOT_SLEW_MAX", "THR_MDL_FAC", "SDLOG_PROFILE",
    ),
)  # fmt: skip


def names(contents: LogContents) -> AutopilotNames:
    """The loops of PX4, the same in all its versions: the topics differ, and are alternatives."""
    if not contents.parameters.get("SENS_BOARD_ROT"):
        return NAMES
    # The board is turned in the vehicle, and a gyroscope on it measures other axes.
    loops = (
        replace(loop, response=tuple(signal for signal in loop.response if signal.topic != GYRO))
        for loop in NAMES.loops
    )
    return replace(NAMES, loops=tuple(loops))
