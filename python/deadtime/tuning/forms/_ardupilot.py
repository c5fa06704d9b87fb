"""Parameters of ArduPilot's Copter.

The rate loops (`ATC_RAT_*`) are an `AC_PID`: on the error in rad/s, to the motors' full torque,
-1 to 1; its derivative is that of the error, behind FLTD of one pole. FLTE, another pole on the
error, is 0 by default but for yaw, velocities and the vertical acceleration. The angle loops
(`ATC_ANG_*_P`) and position loops (`PSC_POSXY_P`, `PSC_POSZ_P`) are proportional, in 1/s, while
the error is small against the limits of acceleration. The velocity loops (`PSC_VEL*`) give an
acceleration; the vertical acceleration loop (`PSC_ACCZ_*`) works in cm/s² and gives thousandths of
the throttle, so that a unit of its gains is 0.1 in m/s² to full throttle. Since 4.7 the position
loops have the names `PSC_NE_*` and `PSC_D_*`, and the acceleration loop works in m/s² and throttle.
"""

from __future__ import annotations

import re
from dataclasses import replace

from deadtime.tuning.forms._firmware import FirmwareLoop

SOURCE = (
    "ArduPilot Copter 4.0 to 4.6: libraries/AC_PID/AC_PID.cpp, AC_PID_Basic.cpp, AC_PID_2D.cpp and "
    "libraries/AC_AttitudeControl/AC_PosControl.cpp"
)

#: A line of a .param file, with a comma, white space or an equals sign.
LINE = re.compile(r"^\s*([A-Z][A-Z0-9_]+)[\s,=]+([-+0-9.eE]+)", re.M)

WRITTEN = "{name},{value}"

#: Throttle, 0 to 1, per m/s² of a unit of PSC_ACCZ_P: 100 cm to a metre, and thousandths.
ACCELERATION = 100.0 * 0.001

BOTH = "The parameters apply to north and east together."
SMALL = (
    "The firmware limits the acceleration, so for large errors it uses a "
    "square-root law. The gain applies to small errors."
)

FILTERED = (
    "The firmware also filters the error, with the corner {name}_FLTE. The design does not "
    "include this filter. Set the corner to 0, or to at least ten times the crossover "
    "frequency."
)

#: The first firmware with the names of 4.7.
RENAMED = (4, 7)


def _rate(axis: str, note: str = "") -> FirmwareLoop:
    return _pid(f"ATC_RAT_{axis}", 1.0, "rad/s to torque, -1 to 1", note)


def _angle(axis: str) -> FirmwareLoop:
    return FirmwareLoop(f"ATC_ANG_{axis}_P", units="rad to rad/s", note=SMALL)


def _cascade(name: str, scale: float = 1.0, units: str = "", note: str = "") -> FirmwareLoop:
    return _pid(name, scale, units, f"{note} {FILTERED}".strip())


def _pid(name: str, scale: float, units: str, note: str) -> FirmwareLoop:
    note = note.format(name=name)
    return FirmwareLoop(
        f"{name}_P", f"{name}_I", f"{name}_D", f"{name}_FLTD", scale=scale, units=units, note=note
    )


HORIZONTAL = FirmwareLoop("PSC_POSXY_P", units="m to m/s", span=(0.5, 2.0), note=f"{BOTH} {SMALL}")
VELOCITY = _cascade("PSC_VELXY", units="m/s to m/s²", note=BOTH)

LOOPS = {
    "roll rate": _rate("RLL"),
    "pitch rate": _rate("PIT"),
    "yaw rate": _rate("YAW", FILTERED),
    "roll": _angle("RLL"),
    "pitch": _angle("PIT"),
    "yaw": _angle("YAW"),
    "north velocity": VELOCITY,
    "east velocity": VELOCITY,
    "north position": HORIZONTAL,
    "east position": HORIZONTAL,
    "vertical acceleration": _cascade("PSC_ACCZ", ACCELERATION, "m/s² to throttle, 0 to 1"),
    "vertical speed": _cascade("PSC_VELZ", units="m/s to m/s²"),
    "altitude": FirmwareLoop("PSC_POSZ_P", units="m to m/s", span=(1.0, 3.0), note=SMALL),
}

#: Names until 4.6, and since 4.7.
NEW_NAMES = {
    "PSC_POSXY": "PSC_NE_POS",
    "PSC_VELXY": "PSC_NE_VEL",
    "PSC_POSZ": "PSC_D_POS",
    "PSC_VELZ": "PSC_D_VEL",
    "PSC_ACCZ": "PSC_D_ACC",
}


def loops(version: tuple[int, ...] | None) -> dict[str, FirmwareLoop]:
    """The loops by name, with the names of a version; those until 4.6 where none is given."""
    if version is None or version < RENAMED:
        return LOOPS
    return {name: _renamed(found) for name, found in LOOPS.items()}


def _renamed(found: FirmwareLoop) -> FirmwareLoop:
    for old, new in NEW_NAMES.items():
        if found.proportional.startswith(old):
            return replace(
                found,
                proportional=found.proportional.replace(old, new),
                integral=found.integral.replace(old, new),
                derivative=found.derivative.replace(old, new),
                corner=found.corner.replace(old, new),
                note=found.note.replace(old, new),
                scale=1.0,
            )
    return found
