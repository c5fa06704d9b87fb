"""Loops of PX4 in the logs that it wrote before ULog: those of sdlog2, in the frame of DataFlash.

Their messages have no time: a message TIME stands before all that are logged together. Columns
count down, in rad, rad/s, m and m/s (`src/modules/sdlog2/sdlog2_messages.h` of PX4).
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from deadtime.logs._conditions import closed_where, in_the_air, state
from deadtime.logs._names import AutopilotNames, Condition, LoopNames, Signal
from deadtime.logs._rotations import unwrapped

#: ``STAT.ArmState`` of an armed vehicle.
ARMED = 2

#: Numbers of ``STAT.MainState`` that mean the same in every version: manual, altitude, position,
#: automatic, and stabilized; from 4 to 7 the versions differ.
MODES = {0: "Manual", 1: "Altitude", 2: "Position", 3: "Auto", 8: "Stabilized"}
VERTICAL, HORIZONTAL = (1, 2, 3), (2, 3)

DOWN = "downwards to upwards"


def _in(numbers: Collection[int]) -> Condition:
    known = list(numbers)
    return closed_where(state("STAT", "MainState", lambda values: np.isin(values, known)))


FLYING = (
    Condition(state("STAT", "ArmState", lambda values: values == ARMED), "the vehicle is disarmed"),
    Condition(
        in_the_air("STAT", "Landed", lambda values: values == 0),
        "the vehicle is on the ground or lands",
    ),
)


def _inner(axis: str) -> list[LoopNames]:
    name = axis.capitalize()
    asked = Signal("ARSP", (f"{name}RateSP",), "rad/s")
    turned = unwrapped if axis == "yaw" else None
    rule = "without jumps of a full turn" if axis == "yaw" else ""
    tilt, tilted = (
        Signal(topic, (column,), "rad", derive=turned, rule=rule)
        for topic, column in (("ATSP", f"{name}SP"), ("ATT", name))
    )
    return [
        LoopNames(
            f"{axis} rate", axis, "rate", (asked,), (Signal("ATT", (f"{name}Rate",), "rad/s"),),
            (Signal("ATTC", (name,)),), FLYING,
        ),
        LoopNames(axis, axis, "attitude", (tilt,), (tilted,), (asked,), (*FLYING, _in(MODES))),
    ]  # fmt: skip


def _outer(axis: str, letter: str) -> list[LoopNames]:
    upwards = axis == "vertical"
    sign, rule = (-1.0, DOWN) if upwards else (1.0, "")
    conditions = (*FLYING, _in(VERTICAL if upwards else HORIZONTAL))
    asked = tuple(
        Signal(topic, (f"V{letter}",), "m/s", sign, rule=rule) for topic in ("GVSP", "LPSP")
    )
    return [
        LoopNames(
            "vertical speed" if upwards else f"{axis} velocity", axis, "velocity", asked,
            (Signal("LPOS", (f"V{letter}",), "m/s", sign, rule=rule),), conditions=conditions,
        ),
        LoopNames(
            "altitude" if upwards else f"{axis} position", axis, "position",
            (Signal("LPSP", (letter,), "m", sign, rule=rule),),
            (Signal("LPOS", (letter,), "m", sign, rule=rule),), asked, conditions,
        ),
    ]  # fmt: skip


AXES = ("roll", "pitch", "yaw")
PLACES = (("north", "X"), ("east", "Y"), ("vertical", "Z"))

LOOPS = (
    *(loop for axis in AXES for loop in _inner(axis)),
    *(loop for axis, letter in PLACES for loop in _outer(axis, letter)),
)


def sdlog2_names(known: AutopilotNames) -> AutopilotNames:
    """The loops in these messages; the parameters are those of every PX4 log."""
    return AutopilotNames(LOOPS, known.key_parameters)
