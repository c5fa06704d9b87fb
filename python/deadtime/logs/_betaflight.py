"""Loops of Betaflight, Cleanflight and INAV in their Blackbox logs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from deadtime._base.arrays import Array, Mask
from deadtime.logs._blackbox_modes import INAV
from deadtime.logs._conditions import closed_where, state
from deadtime.logs._contents import LogContents
from deadtime.logs._names import AutopilotNames, Condition, Kind, LoopNames, Signal
from deadtime.logs._sticks import curve_of_head, has_rates, is_successor, setpoint_of_controller


def _has_bit(*bits: int) -> Callable[[Array], Mask]:
    """Whether one of these bits of ``flightModeFlags`` is set."""
    mask = sum(1 << bit for bit in bits)
    return lambda flags: (flags.astype(np.int64) & mask) != 0


def _in_modes(*modes: str) -> Condition:
    """In one of these modes of INAV; several can be active at once."""
    bits = [bit for bit, name in INAV.items() if name in modes]
    return closed_where(state("slow", "flightModeFlags", _has_bit(*bits)))


ARMED = Condition(state("slow", "flightModeFlags", _has_bit(0)), "the vehicle is disarmed")
#: In passthrough the sticks move the servos.
CONTROLLED = closed_where(state("slow", "flightModeFlags", lambda flags: ~_has_bit(10)(flags)))
HELD_PLACE = _in_modes("NAV POSHOLD", "NAV RTH", "NAV WP")
HELD_HEIGHT = _in_modes("NAV ALTHOLD", "NAV POSHOLD", "NAV RTH", "NAV WP")


def _sum(*terms: Array) -> Array:
    return np.asarray(np.sum(terms, axis=0))


def _controller(axis: int) -> tuple[Signal, ...]:
    """What the rate controller gives: the sum of its terms, of which D and F may be missing."""
    return tuple(
        Signal(
            "main",
            tuple(f"axis{term}[{axis}]" for term in terms),
            derive=_sum,
            rule=f"sum of {', '.join(terms)}",
        )
        for terms in ("PIDFS", "PIDF", "PIF", "PID", "PI")
    )


def _asked(axis: int, contents: LogContents) -> tuple[Signal, ...]:
    """The setpoint of a rate, or in a log without it what the sticks ask for."""
    stick = f"rcCommand[{axis}]"
    logged = Signal("main", (f"setpoint[{axis}]",), "deg/s")
    if has_rates(contents.firmware, contents.parameters):
        derive = curve_of_head(contents.parameters, axis)
        rule = "in deg/s, computed from the rates in the header"
        return logged, Signal("main", (stick,), "deg/s", derive=derive, rule=rule)
    columns = (stick, f"gyroADC[{axis}]", f"axisP[{axis}]")
    rule = "in deg/s, computed from the P term of the controller"
    derived = Signal("main", columns, "deg/s", derive=setpoint_of_controller, rule=rule)
    return logged, derived


def _rate(
    name: str, axis: int, setpoint: tuple[Signal, ...], conditions: tuple[Condition, ...]
) -> LoopNames:
    return LoopNames(
        name=f"{name} rate",
        axis=name,
        kind="rate",
        setpoint=setpoint,
        response=(Signal("main", (f"gyroADC[{axis}]",), "deg/s"),),
        actuator=_controller(axis),
        conditions=conditions,
    )


def _translation(
    name: str, axis: str, kind: Kind, k: int, actuator: tuple[Signal, ...]
) -> LoopNames:
    """A velocity or a position loop of INAV; its vertical axis counts upwards."""
    what, unit = ("Vel", "cm/s") if kind == "velocity" else ("Pos", "cm")
    return LoopNames(
        name=name,
        axis=axis,
        kind=kind,
        setpoint=(Signal("main", (f"navTgt{what}[{k}]",), unit),),
        response=(Signal("main", (f"nav{what}[{k}]",), unit),),
        actuator=actuator,
        conditions=(ARMED, HELD_HEIGHT if axis == "vertical" else HELD_PLACE),
    )


def _translations() -> list[LoopNames]:
    loops = []
    for k, axis in enumerate(("north", "east", "vertical")):
        is_vertical = axis == "vertical"
        speed = "vertical speed" if is_vertical else f"{axis} velocity"
        place = "altitude" if is_vertical else f"{axis} position"
        given = (Signal("main", (f"mcVelAxisOut[{k}]",)),)
        asked = (Signal("main", (f"navTgtVel[{k}]",), "cm/s"),)
        loops += [
            _translation(speed, axis, "velocity", k, given),
            _translation(place, axis, "position", k, asked),
        ]
    return loops


KEY_PARAMETERS = (
    "looptime", "gyro_sync_denom", "pid_process_denom", "P interval*", "gyro_l*", "gyro_notch_*",
    "gyro_hardware_lpf", "gyro_rpm_notch_*", "rpm_filter_*", "dyn_notch_*", "dynamicGyroNotch*",
    "dterm_*", "yaw_lowpass_hz", "rollPID*", "pitchPID*", "yawPID*", "d_min*", "d_max*",
    "ff_weight*", "feedforward_*", "rc_rates*", "rates*", "rate_limits*", "rc_expo*",
    "motor_poles", "motor_pwm_protocol", "motor_pwm_rate", "dshot_bidir",
    "blackbox_high_resolution",
)  # fmt: skip


def _conditions(contents: LogContents) -> tuple[Condition, ...]:
    """When the sticks set the rates; those of a log with setpoints are followed in every mode."""
    main, bits = contents.topics.get("main"), (1, 2)
    armed: tuple[Condition, ...] = (ARMED,)
    if contents.autopilot == "Cleanflight" and not is_successor(contents.firmware):
        # Its flags are those of modes alone, and it logs while it is armed.
        armed, bits = (), (0, 1)
    if main is not None and "setpoint[0]" in main.columns:
        return armed
    angles = _has_bit(*bits)
    sticks = state("slow", "flightModeFlags", lambda flags: ~angles(flags))
    return (
        *armed,
        Condition(
            sticks, "the sticks set angles, and the rates that follow from them are not logged"
        ),
    )


def names(contents: LogContents) -> AutopilotNames:
    """Rates of all; velocities and positions where INAV navigates."""
    axes = tuple(enumerate(("roll", "pitch", "yaw")))
    if contents.autopilot != "INAV":
        conditions = _conditions(contents)
        rates = [_rate(name, k, _asked(k, contents), conditions) for k, name in axes]
        return AutopilotNames(rates, KEY_PARAMETERS)
    rates = [
        _rate(name, k, (Signal("main", (f"axisRate[{k}]",), "deg/s"),), (ARMED, CONTROLLED))
        for k, name in axes
    ]
    return AutopilotNames([*rates, *_translations()], KEY_PARAMETERS)
