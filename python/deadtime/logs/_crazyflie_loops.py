"""Loops of a Crazyflie in the logs of its micro-SD card.

The log holds what its configuration asked for. A log without the setpoints, such as one of motors
and gyroscope alone, has no loop. What a controller commands to roll, pitch, yaw and thrust is also
in the motors, from which the mixer is undone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deadtime._base.arrays import Array
from deadtime.logs._conditions import first_logged, state
from deadtime.logs._contents import LogContents
from deadtime.logs._names import AutopilotNames, Condition, Kind, LoopNames, Signal
from deadtime.logs._rotations import heading

#: The event that is logged at a fixed rate.
TOPIC = "fixedFrequency"
RUNNING = Condition(
    first_logged(
        state(TOPIC, "stabilizer.thrust", lambda values: values > 0),
        state(TOPIC, "motor.m1", lambda values: values > 0),
    ),
    "the motors are off",
)


#: How the mixer adds what is commanded to thrust, half of roll, half of pitch, and yaw, to each of
#: the four motors; and what that is worth of one command, from all motors together.
MIXED = {
    "roll": ((-1.0, -1.0, 1.0, 1.0), 0.5),
    "pitch": ((1.0, -1.0, -1.0, 1.0), 0.5),
    "yaw": ((1.0, -1.0, 1.0, -1.0), 0.25),
    "thrust": ((1.0, 1.0, 1.0, 1.0), 0.25),
}

#: The yaw command turns the vehicle to the other side, and tilts move it against their sign.
AGAINST = "with the opposite sign"


def _motors(command: str, sign: float = 1.0) -> Signal:
    """A command as the motors got it."""
    ways, share = MIXED[command]

    def undone(*motors: Array) -> Array:
        return np.asarray(share * np.einsum("k,kn->n", ways, motors))

    return Signal(
        TOPIC, tuple(f"motor.m{k}" for k in range(1, 5)), "", sign, derive=undone,
        rule=f"{command} of the four motors",
    )  # fmt: skip


def _signal(column: str, unit: str = "", sign: float = 1.0, rule: str = "") -> Signal:
    return Signal(TOPIC, (column,), unit, sign, rule=rule)


def _rate(axis: str, gyro: str, estimate: str) -> LoopNames:
    """The rate loop; the firmware's pitch counts against the y axis of the gyroscope.

    So does the pitch rate of its estimator. Its yaw command counts against the yaw rate.
    """
    sign, rule = (-1.0, "pitch as the controller uses it") if axis == "pitch" else (1.0, "")
    turned, why = (-1.0, AGAINST) if axis == "yaw" else (1.0, "")
    return LoopNames(
        name=f"{axis} rate",
        axis=axis,
        kind="rate",
        setpoint=(_signal(f"controller.{axis}Rate", "deg/s"),),
        response=(
            _signal(f"gyro.{gyro}", "deg/s", sign, rule),
            _signal(f"stateEstimateZ.{estimate}", "mrad/s"),
        ),
        actuator=(
            _signal(f"controller.cmd_{axis}", "", turned, why),
            _motors(axis, turned),
        ),
        conditions=(RUNNING,),
    )


def _angle(column: str, axis: str) -> Signal:
    return heading(TOPIC, column) if axis == "yaw" else _signal(column, "deg")


def _attitude(axis: str) -> LoopNames:
    return LoopNames(
        name=axis,
        axis=axis,
        kind="attitude",
        setpoint=(_angle(f"controller.{axis}", axis),),
        response=(_angle(f"stabilizer.{axis}", axis), _angle(f"stateEstimate.{axis}", axis)),
        actuator=(_signal(f"controller.{axis}Rate", "deg/s"),),
        conditions=(RUNNING,),
    )


def _translation(
    name: str, axis: str, kind: Kind, setpoint: str, response: str, *actuator: Signal
) -> LoopNames:
    unit = "m/s" if kind == "velocity" else "m"
    return LoopNames(
        name=name,
        axis=axis,
        kind=kind,
        setpoint=(_signal(setpoint, unit),),
        response=(_signal(response, unit),),
        actuator=actuator,
        conditions=(RUNNING,),
    )


def _translations() -> list[LoopNames]:
    """Velocities and positions; the horizontal ones along x and y of the vehicle, not north."""
    loops = []
    for axis, tilt in (("x", "pitch"), ("y", "roll")):
        target = f"posCtl.targetV{axis.upper()}"
        loops += [
            _translation(
                f"{axis} velocity", axis, "velocity", target, f"posCtl.bodyV{axis.upper()}",
                _signal(f"controller.{tilt}", "deg", -1.0, AGAINST),
            ),
            _translation(
                f"{axis} position", axis, "position", f"posCtl.target{axis.upper()}",
                f"posCtl.body{axis.upper()}", _signal(target, "m/s"),
            ),
        ]  # fmt: skip
    target = "posCtl.targetVZ"
    speed = _translation(
        "vertical speed", "vertical", "velocity", target, "stateEstimate.vz",
        _signal("stabilizer.thrust"), _signal("controller.actuatorThrust"), _motors("thrust"),
    )  # fmt: skip
    altitude = _translation(
        "altitude", "vertical", "position", "posCtl.targetZ", "stateEstimate.z",
        _signal(target, "m/s"),
    )  # fmt: skip
    asked = (*altitude.setpoint, _signal("ctrltarget.z", "m"), _signal("ctrltargetZ.z", "mm"))
    estimates = (_signal("stateEstimate.z", "m"), _signal("stateEstimateZ.z", "mm"))
    return [*loops, speed, replace(altitude, setpoint=asked, response=estimates)]


NAMES = AutopilotNames(
    loops=(
        _rate("roll", "x", "rateRoll"),
        _rate("pitch", "y", "ratePitch"),
        _rate("yaw", "z", "rateYaw"),
        *map(_attitude, ("roll", "pitch", "yaw")),
        *_translations(),
    )
)


def names(contents: LogContents) -> AutopilotNames:
    """The loops whose signals the configuration of the log can ask for."""
    return NAMES
