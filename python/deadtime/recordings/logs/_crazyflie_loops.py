"""Loops of a Crazyflie in the logs of its micro-SD card.

The log holds what its configuration asked for. A log without the setpoints, such as one of motors
and gyroscope alone, has no loop.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deadtime.recordings.logs._conditions import first_told, state
from deadtime.recordings.logs._contents import LogContents
from deadtime.recordings.logs._names import AutopilotNames, Condition, Kind, LoopNames, Signal
from deadtime.recordings.logs._rotations import unwrapped

#: The event that is logged at a fixed rate.
TOPIC = "fixedFrequency"
RUNNING = Condition(
    first_told(
        state(TOPIC, "stabilizer.thrust", lambda values: values > 0),
        state(TOPIC, "motor.m1", lambda values: values > 0),
    ),
    "the motors are off",
)


def _signal(column: str, unit: str = "", sign: float = 1.0, rule: str = "") -> Signal:
    return Signal(TOPIC, (column,), unit, sign, rule=rule)


def _rate(axis: str, gyro: str, estimate: str) -> LoopNames:
    """The rate loop; the firmware's pitch counts against the y axis of the gyroscope."""
    sign, rule = (-1.0, "the pitch of the controller") if axis == "pitch" else (1.0, "")
    return LoopNames(
        name=f"{axis} rate",
        axis=axis,
        kind="rate",
        setpoint=(_signal(f"controller.{axis}Rate", "deg/s"),),
        response=(
            _signal(f"gyro.{gyro}", "deg/s", sign, rule),
            _signal(f"stateEstimateZ.{estimate}", "mrad/s", sign, rule),
        ),
        actuator=(_signal(f"controller.cmd_{axis}"),),
        conditions=(RUNNING,),
    )


def _angle(column: str, axis: str) -> Signal:
    if axis != "yaw":
        return _signal(column, "deg")
    return Signal(
        TOPIC, (column,), "rad",
        derive=lambda degrees: unwrapped(degrees * (np.pi / 180.0)),
        rule="[deg] to rad without jumps of a turn",
    )  # fmt: skip


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
    name: str, axis: str, kind: Kind, setpoint: str, response: str, actuator: Signal
) -> LoopNames:
    unit = "m/s" if kind == "velocity" else "m"
    return LoopNames(
        name=name,
        axis=axis,
        kind=kind,
        setpoint=(_signal(setpoint, unit),),
        response=(_signal(response, unit),),
        actuator=(actuator,),
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
                _signal(f"controller.{tilt}", "deg"),
            ),
            _translation(
                f"{axis} position", axis, "position", f"posCtl.target{axis.upper()}",
                f"posCtl.body{axis.upper()}", _signal(target, "m/s"),
            ),
        ]  # fmt: skip
    thrust, target = _signal("stabilizer.thrust"), "posCtl.targetVZ"
    speed = _translation(
        "vertical speed", "vertical", "velocity", target, "stateEstimate.vz", thrust
    )
    altitude = _translation(
        "altitude", "vertical", "position", "posCtl.targetZ", "stateEstimate.z",
        _signal(target, "m/s"),
    )  # fmt: skip
    estimates = (_signal("stateEstimate.z", "m"), _signal("stateEstimateZ.z", "mm"))
    return [*loops, speed, replace(altitude, response=estimates)]


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
