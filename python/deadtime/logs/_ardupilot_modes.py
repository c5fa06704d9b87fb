"""Flight modes of ArduPilot by their numbers, and the loops they close."""

from __future__ import annotations

COPTER = {
    0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL",
    7: "CIRCLE", 8: "POSITION", 9: "LAND", 10: "OF_LOITER", 11: "DRIFT", 13: "SPORT", 14: "FLIP",
    15: "AUTOTUNE", 16: "POSHOLD", 17: "BRAKE", 18: "THROW", 19: "AVOID_ADSB", 20: "GUIDED_NOGPS",
    21: "SMART_RTL", 22: "FLOWHOLD", 23: "FOLLOW", 24: "ZIGZAG", 25: "SYSTEMID", 26: "AUTOROTATE",
    27: "AUTO_RTL", 28: "TURTLE",
}  # fmt: skip

PLANE = {
    0: "MANUAL", 1: "CIRCLE", 2: "STABILIZE", 3: "TRAINING", 4: "ACRO", 5: "FBWA", 6: "FBWB",
    7: "CRUISE", 8: "AUTOTUNE", 10: "AUTO", 11: "RTL", 12: "LOITER", 13: "TAKEOFF",
    14: "AVOID_ADSB", 15: "GUIDED", 16: "INITIALISING", 17: "QSTABILIZE", 18: "QHOVER",
    19: "QLOITER", 20: "QLAND", 21: "QRTL", 22: "QAUTOTUNE", 23: "QACRO", 24: "THERMAL",
    25: "LOITER_ALT_QLAND",
}  # fmt: skip

ROVER = {
    0: "MANUAL", 1: "ACRO", 2: "LEARNING", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW",
    7: "SIMPLE", 8: "DOCK", 9: "CIRCLE", 10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED",
    16: "INITIALISING",
}  # fmt: skip

SUB = {
    0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 7: "CIRCLE", 9: "SURFACE",
    16: "POSHOLD", 19: "MANUAL", 20: "MOTOR_DETECT", 21: "SURFTRAK",
}  # fmt: skip

#: Modes in which no controller sets the attitude.
UNCONTROLLED = frozenset({"MANUAL", "TURTLE", "INITIALISING", "MOTOR_DETECT"})

#: Modes of a plane that set its roll and pitch, and those of a QuadPlane that set the attitude of
#: its rotors, or their rates.
PLANE_ANGLES = frozenset({
    "AUTO", "AUTOTUNE", "AVOID_ADSB", "CIRCLE", "CRUISE", "FBWA", "FBWB", "GUIDED", "LOITER", "RTL",
    "STABILIZE", "TAKEOFF", "THERMAL",
})  # fmt: skip
Q_ANGLES = frozenset({"QAUTOTUNE", "QHOVER", "QLAND", "QLOITER", "QRTL", "QSTABILIZE"})
Q_RATES = Q_ANGLES | {"QACRO"}

#: Modes of a rover that set its turn rate and its speed.
STEERED = frozenset({
    "ACRO", "AUTO", "CIRCLE", "DOCK", "FOLLOW", "GUIDED", "LOITER", "RTL", "SIMPLE", "SMART_RTL",
    "STEERING",
})  # fmt: skip

#: Modes that close the horizontal loops, and those that close the vertical ones.
HORIZONTAL = frozenset({
    "AUTO", "GUIDED", "LOITER", "RTL", "CIRCLE", "POSITION", "LAND", "OF_LOITER", "POSHOLD",
    "BRAKE", "THROW", "AVOID_ADSB", "SMART_RTL", "FOLLOW", "ZIGZAG", "AUTO_RTL", "QLOITER",
    "QLAND", "QRTL",
})  # fmt: skip
VERTICAL = (HORIZONTAL - {"POSITION"}) | {
    "ALT_HOLD", "SPORT", "AUTOTUNE", "GUIDED_NOGPS", "FLOWHOLD", "QHOVER", "SURFACE", "SURFTRAK",
}  # fmt: skip
