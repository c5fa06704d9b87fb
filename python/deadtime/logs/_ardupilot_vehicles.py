"""Loops of ArduPilot's planes and rovers, and of its mode that injects a signal."""

from __future__ import annotations

import numpy as np

from deadtime.logs._ardupilot_modes import HORIZONTAL, PLANE_ANGLES, Q_ANGLES, Q_RATES, STEERED
from deadtime.logs._conditions import closed_where, in_modes, state
from deadtime.logs._names import Condition, LoopNames, Signal
from deadtime.logs._rotations import heading

#: What the signal of the mode SYSTEMID is added to, by SIDS.Ax: a set angle (as the pilot's, and
#: again after it) or a set rate, with the column of the gyroscope.
INJECTED = (
    ("roll", "Roll", "Gx", (1, 4), 7),
    ("pitch", "Pitch", "Gy", (2, 5), 8),
    ("yaw", "Yaw", "Gz", (3, 6), 9),
)

#: Rates of a controller's message hold what its filter FLTT leaves of the setpoint.
FILTERED = "behind the filter of the setpoint"


FORWARD = closed_where(in_modes(PLANE_ANGLES | {"ACRO"}))
TILTED = closed_where(in_modes(PLANE_ANGLES | Q_ANGLES))
HOVERING = closed_where(in_modes(Q_RATES))
TURNED = closed_where(in_modes(Q_ANGLES))


def plane(rate: str, flying: tuple[Condition, ...]) -> list[LoopNames]:
    """Attitude of a plane, its rates, and those of the rotors of a QuadPlane.

    The message RATE, whose unit is `rate`, is of the rotors alone, and a plane without them logs 0
    for a desired yaw. The controllers of its surfaces log degrees, those of its rotors radians.
    """
    rates, hovering, angles = [], [], []
    for axis, letter in (("roll", "R"), ("pitch", "P"), ("yaw", "Y")):
        rotors = f"PIQ{letter}"
        hovering.append(
            LoopNames(
                f"hover {axis} rate", axis, "rate",
                (Signal("RATE", (f"{letter}Des",), rate), Signal(rotors, ("Tar",), "rad/s")),
                response=(Signal("RATE", (letter,), rate), Signal(rotors, ("Act",), "rad/s")),
                actuator=(Signal("RATE", (f"{letter}Out",)),),
                conditions=(*flying, HOVERING),
            )
        )  # fmt: skip
        if axis == "yaw":
            turned = (heading("ATT", "DesYaw"),), (heading("ATT", "Yaw"),)
            angles.append(LoopNames(axis, axis, "attitude", *turned, (), (*flying, TURNED)))
            continue
        name, surfaces = axis.capitalize(), f"PID{letter}"
        asked = Signal(surfaces, ("Tar",), "deg/s", rule=FILTERED)
        rates.append(
            LoopNames(
                f"{axis} rate", axis, "rate", (asked,), (Signal(surfaces, ("Act",), "deg/s"),),
                conditions=(*flying, FORWARD),
            )
        )  # fmt: skip
        angles.append(
            LoopNames(
                axis, axis, "attitude",
                (Signal("ATT", (f"Des{name}",), "deg"), Signal("CTUN", (f"Nav{name}",), "deg")),
                response=(Signal("ATT", (name,), "deg"), Signal("CTUN", (name,), "deg")),
                actuator=(asked,), conditions=(*flying, TILTED),
            )
        )  # fmt: skip
    return [*rates, *hovering, *angles]


def rover(armed: Condition) -> list[LoopNames]:
    """Turn rate, speed and heading of a rover; its message ATT holds no setpoint of them."""
    driven = (armed, closed_where(in_modes(STEERED)))
    return [
        LoopNames(
            "yaw rate", "yaw", "rate",
            (Signal("STER", ("DesTurnRate",), "deg/s"), Signal("PIDS", ("Tar",), "rad/s")),
            response=(Signal("STER", ("TurnRate",), "deg/s"), Signal("PIDS", ("Act",), "rad/s")),
            actuator=(Signal("STER", ("SteerOut",)),),
            conditions=driven,
        ),
        LoopNames(
            "forward speed", "forward", "velocity",
            (Signal("THR", ("DesSpeed",), "m/s"), Signal("PIDT", ("Tar",), "m/s")),
            response=(Signal("THR", ("Speed",), "m/s"), Signal("PIDT", ("Act",), "m/s")),
            actuator=(Signal("THR", ("ThrOut",)),),
            conditions=driven,
        ),
        LoopNames(
            "yaw", "yaw", "attitude", (heading("NTUN", "DesYaw"),), (heading("NTUN", "Yaw"),),
            actuator=(Signal("STER", ("DesTurnRate",), "deg/s"),),
            conditions=(armed, closed_where(in_modes(HORIZONTAL))),
        ),
    ]  # fmt: skip


def injected(conditions: tuple[Condition, ...]) -> list[LoopNames]:
    """The responses to the signal that the mode SYSTEMID adds to a set rate or angle.

    The signal of the axis is the excitation; what the pilot sets beside it is not in it.
    """
    running = (*conditions, closed_where(in_modes({"SYSTEMID"})))
    loops = []
    for axis, column, gyro, angles, rate in INJECTED:
        loops += [
            LoopNames(
                f"{axis} rate from the injected signal", axis, "rate",
                (Signal("SIDD", ("Targ",), "deg/s"),), (Signal("SIDD", (gyro,), "deg/s"),),
                conditions=(*running, _on((rate,))),
            ),
            LoopNames(
                f"{axis} from the injected signal", axis, "attitude",
                (Signal("SIDD", ("Targ",), "deg"),), (Signal("ATT", (column,), "deg"),),
                conditions=(*running, _on(angles)),
            ),
        ]  # fmt: skip
    return loops


def _on(numbers: tuple[int, ...]) -> Condition:
    """Where the signal is added to these."""
    windows = state("SIDS", "Ax", lambda axes: np.isin(axes, numbers))
    return Condition(windows, "the test signal is added to another command")
