"""Loops of ArduPilot in its DataFlash logs."""

from __future__ import annotations

import numpy as np

from deadtime.logs._ardupilot_modes import HORIZONTAL, UNCONTROLLED, VERTICAL
from deadtime.logs._ardupilot_vehicles import FILTERED, injected, plane, rover
from deadtime.logs._conditions import closed_where, in_modes, in_the_air, not_in_modes, state
from deadtime.logs._contents import LogContents
from deadtime.logs._names import AutopilotNames, Condition, LoopNames, Signal
from deadtime.logs._rotations import heading

DEGREE = np.pi / 180.0

#: The message of a controller is taken where it has this many times the rows of RATE, because its
#: setpoint is the one behind a filter.
DENSER = 2

ARMED = Condition(state("armed", "state", lambda values: values > 0), "the vehicle is disarmed")
IN_THE_AIR = Condition(
    in_the_air("landed", "state", lambda values: values == 0),
    "the vehicle is on the ground or lands",
)
CONTROLLED = closed_where(not_in_modes(UNCONTROLLED))
HELD_HEIGHT = closed_where(in_modes(VERTICAL))
HELD_PLACE = closed_where(in_modes(HORIZONTAL))

#: Firmware of 2014 logs 0 for a height that it does not hold, as in the descent of RTL.
SET_HEIGHT = Condition(
    state("CTUN", "DAlt", lambda values: values != 0.0),
    "in this log, a height that is not set is 0",
)

#: Letter of an axis in the messages RATE, name of its columns in ATT.
AXES = (("roll", "R", "Roll"), ("pitch", "P", "Pitch"), ("yaw", "Y", "Yaw"))

DOWN = "downwards to upwards"


def _inner_loops(contents: LogContents, rate: str) -> list[LoopNames]:
    """Rate and attitude of each axis; the yaw in ATT jumps at north."""
    rates, angles = [], []
    for axis, letter, column in AXES:
        asked, measured = Signal("RATE", (f"{letter}Des",), rate), Signal("RATE", (letter,), rate)
        pid = f"PID{letter}"
        setpoint = [asked, Signal(pid, ("Tar",), "rad/s", rule=FILTERED)]
        response = [measured, Signal(pid, ("Act",), "rad/s")]
        if _denser(contents, pid, "RATE"):
            setpoint, response = setpoint[::-1], response[::-1]
        rates.append(
            LoopNames(
                f"{axis} rate", axis, "rate", setpoint, response,
                actuator=(Signal("RATE", (f"{letter}Out",)),),
                conditions=(ARMED, IN_THE_AIR, CONTROLLED),
            )
        )  # fmt: skip
        desired, found = (
            heading("ATT", name) if axis == "yaw" else Signal("ATT", (name,), "deg")
            for name in (f"Des{column}", column)
        )
        angles.append(
            LoopNames(
                axis, axis, "attitude", (desired,), (found,), (asked,),
                conditions=(ARMED, IN_THE_AIR, CONTROLLED),
            )
        )  # fmt: skip
    return [*rates, *angles]


def _denser(contents: LogContents, topic: str, other: str) -> bool:
    """Whether a topic that has both signals is logged far more often than another."""
    found, slow = contents.topics.get(topic), contents.topics.get(other)
    if found is None or not {"Tar", "Act"} <= set(found.columns):
        return False
    return slow is None or found.time.size > DENSER * slow.time.size


def _horizontal(axis: str, k: int) -> list[LoopNames]:
    """Velocity and position towards north or east, in messages of three generations."""
    letter, old = "NE"[k], "XY"[k]

    def signals(name: str, first_name: str, unit: str) -> tuple[Signal, ...]:
        return (
            Signal(f"PSC{letter}", (f"{name}{letter}",), unit),
            Signal("PSC", (f"{name}{old}",), unit),
            Signal("NTUN", (f"{first_name}{old}",), f"c{unit}"),
        )

    asked = signals("TV", "DVel", "m/s")
    return [
        LoopNames(
            f"{axis} velocity", axis, "velocity", asked,
            response=signals("V", "Vel", "m/s"), actuator=signals("TA", "DAcc", "m/s/s"),
            conditions=(ARMED, IN_THE_AIR, HELD_PLACE),
        ),
        LoopNames(
            f"{axis} position", axis, "position", signals("TP", "DPos", "m"),
            response=signals("P", "Pos", "m"), actuator=asked,
            conditions=(ARMED, IN_THE_AIR, HELD_PLACE),
        ),
    ]  # fmt: skip


def _vertical() -> list[LoopNames]:
    """Vertical speed and altitude: from PSCD, whose numbers are finer, else from CTUN."""
    asked = (
        Signal("PSCD", ("TVD",), "m/s", -1.0, rule=DOWN),
        Signal("CTUN", ("DCRt",), "cm/s"),
    )
    speed = LoopNames(
        "vertical speed", "vertical", "velocity", asked,
        response=(
            Signal("PSCD", ("VD",), "m/s", -1.0, rule=DOWN),
            Signal("CTUN", ("CRt",), "cm/s"),
        ),
        actuator=(Signal("CTUN", ("ThO",)), Signal("CTUN", ("ThrOut",))),
        conditions=(ARMED, IN_THE_AIR, HELD_HEIGHT, SET_HEIGHT),
    )  # fmt: skip
    altitude = LoopNames(
        "altitude", "vertical", "position",
        setpoint=(
            Signal("PSCD", ("TPD",), "m", -1.0, rule=DOWN), Signal("CTUN", ("DAlt",), "m"),
        ),
        response=(Signal("PSCD", ("PD",), "m", -1.0, rule=DOWN), Signal("CTUN", ("Alt",), "m")),
        actuator=asked,
        conditions=(ARMED, IN_THE_AIR, HELD_HEIGHT, SET_HEIGHT),
    )  # fmt: skip
    return [speed, altitude]


def _unit_of_rates(contents: LogContents) -> str:
    """Unit of the messages RATE: firmware of 2014 and 2015 logs hundredths of a degree.

    Logs without units of their own are told apart by the gyroscope, which is in rad/s.
    """
    rate, gyro = contents.topics.get("RATE"), contents.topics.get("IMU")
    if rate is None or gyro is None or "R" not in rate.columns or "GyrX" not in gyro.columns:
        return "deg/s"
    logged, measured = np.nanstd(rate.columns["R"]), np.nanstd(gyro.columns["GyrX"])
    return "cdeg/s" if logged * DEGREE > 10.0 * measured else "deg/s"


KEY_PARAMETERS = (
    "ATC_RAT_*_[PID]", "ATC_RAT_*_FF", "ATC_RAT_*_FLT[TED]", "ATC_ANG_*_P", "ATC_INPUT_TC",
    "ATC_RATE_*_MAX", "RATE_*_[PID]", "STB_*_P", "PSC_*_[PID]", "PSC_*_FLT[TED]", "PSC_POSXY_P",
    "THR_ACCEL_[PID]", "THR_RATE_P", "THR_ALT_P", "INS_GYRO_FILTER", "INS_ACCEL_FILTER",
    "RLL_RATE_[PID]", "PTCH_RATE_[PID]", "RLL2SRV_*", "PTCH2SRV_*", "Q_A_RAT_*_[PID]",
    "ATC_STR_RAT_*", "ATC_SPEED_[PID]", "INS_HNTCH_*", "INS_MPU6K_FILTER", "SCHED_LOOP_RATE",
    "FSTRATE_ENABLE", "MOT_SPIN_*", "MOT_*_EXPO", "MOT_SLEW_*_TIME", "MOT_PWM_TYPE", "LOG_BITMASK",
)  # fmt: skip


def names(contents: LogContents) -> AutopilotNames:
    """The loops of ArduPilot in the messages of all its versions since 2014."""
    vehicle = contents.vehicle.partition(" ")[0]
    rate = _unit_of_rates(contents)
    places = [*_horizontal("north", 0), *_horizontal("east", 1), *_vertical()]
    if vehicle == "Rover":
        return AutopilotNames([*rover(ARMED), *places], KEY_PARAMETERS)
    if vehicle == "Plane":
        return AutopilotNames([*plane(rate, (ARMED, IN_THE_AIR)), *places], KEY_PARAMETERS)
    loops = [*_inner_loops(contents, rate), *places, *injected((ARMED, IN_THE_AIR))]
    return AutopilotNames(loops, KEY_PARAMETERS)
