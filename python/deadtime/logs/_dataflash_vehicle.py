"""Which vehicle of ArduPilot a DataFlash log is of: by its texts, parameters or messages."""

from __future__ import annotations

import re
from collections.abc import Mapping

from deadtime.logs._dataflash_messages import Messages

#: The message that names vehicle and version; firmware of 2014 has a small v.
FIRMWARE = re.compile(
    r"(?:APM:|Ardu)?(?P<vehicle>Copter|Plane|Rover|Sub|Blimp\w*|Tracker) [Vv]\d\S*.*"
)

#: Parameters that only one vehicle has, of several generations of its firmware.
PARAMETERS = {
    "Copter": frozenset({
        "ESC_CALIBRATION", "LAND_SPEED_HIGH", "PILOT_TKOFF_ALT", "PILOT_VELZ_MAX", "RTL_LOIT_TIME",
        "SUPER_SIMPLE", "WP_YAW_BEHAVIOR",
    }),
    "Plane": frozenset({
        "ARSPD_FBW_MAX", "AIRSPEED_MAX", "KFF_RDDRMIX", "LIM_ROLL_CD", "ROLL_LIMIT_DEG",
        "STAB_PITCH_DOWN", "TKOFF_THR_MINSPD", "USE_REV_THRUST",
    }),
    "Rover": frozenset({
        "CRUISE_SPEED", "PIVOT_TURN_ANGLE", "SPEED_TURN_GAIN", "TURN_RADIUS", "WP_PIVOT_ANGLE",
    }),
    "Sub": frozenset({"JS_GAIN_DEFAULT", "JS_LIGHTS_STEPS", "SURFACE_DEPTH", "FS_LEAK_ENABLE"}),
}  # fmt: skip

#: Columns of a message that only one vehicle logs. A Sub logs those of a Copter.
COLUMNS = (
    ("Plane", "CTUN", "NavRoll"),
    ("Rover", "CTUN", "Steer"),
    ("Rover", "STER", "SteerOut"),
    ("Rover", "THR", "DesSpeed"),
)


def vehicle_of(messages: Messages, parameters: Mapping[str, float]) -> tuple[str, str, str]:
    """Vehicle and firmware, or what is known of them, and how the vehicle was recognized."""
    texts = [*messages.texts("MSG", "Message"), *messages.texts("VER", "FWS")]
    named = next(filter(None, map(FIRMWARE.fullmatch, texts)), None)
    if named is not None:
        return named["vehicle"], named[0], ""
    shown = [vehicle for vehicle, own in PARAMETERS.items() if own & parameters.keys()]
    if len(shown) == 1:
        return (
            shown[0],
            "",
            (f"the log does not name its vehicle, but its parameters are those of a {shown[0]}"),
        )
    logged = {
        vehicle
        for vehicle, name, column in COLUMNS
        if name in messages and column in messages[name].columns
    }
    if len(logged) == 1 and not shown:
        (vehicle,) = logged
        return (
            vehicle,
            "",
            (f"the log does not name its vehicle, but its messages are those of a {vehicle}"),
        )
    return "", "", ""
