"""Parameters of PX4's multicopters.

The rate loops give u = K (P e + I ∫ e dt - D dω/dt), from rad/s to the torque, -1 to 1; the
derivative is that of the measured rate, behind IMU_DGYRO_CUTOFF, of one pole since 1.13. The angle
and position loops are proportional, in 1/s. The velocity loops give an acceleration,
P e + I ∫ e dt - D dv/dt, with the derivative behind MPC_VELD_LP.
"""

from __future__ import annotations

import re

from deadtime.tuning.forms._firmware import FirmwareLoop

SOURCE = (
    "PX4 1.13 to 1.15: src/modules/mc_rate_control/MulticopterRateControl.cpp and "
    "src/modules/mc_pos_control/PositionControl/PositionControl.cpp"
)

#: A line of the shell, or one of a ground station's file: component, system, name, value, type.
LINE = re.compile(
    r"^\s*(?:param\s+set(?:-default)?\s+|\d+\s+\d+\s+)([A-Z][A-Z0-9_]+)\s+([-+0-9.eE]+)", re.M
)

WRITTEN = "param set {name} {value}"

BOTH = "The parameters apply to north and east together."
ALL_AXES = "IMU_DGYRO_CUTOFF applies to all axes."


def _rate(axis: str, span: tuple[float, float]) -> FirmwareLoop:
    name = f"MC_{axis}RATE"
    return FirmwareLoop(
        f"{name}_P", f"{name}_I", f"{name}_D", "IMU_DGYRO_CUTOFF", "measurement",
        overall=f"{name}_K", units="rad/s to torque, -1 to 1", span=span, note=ALL_AXES,
    )  # fmt: skip


def _angle(axis: str) -> FirmwareLoop:
    return FirmwareLoop(f"MC_{axis}_P", units="rad to rad/s")


def _velocity(name: str, span: tuple[float, float], note: str = "") -> FirmwareLoop:
    return FirmwareLoop(
        f"{name}_P_ACC", f"{name}_I_ACC", f"{name}_D_ACC", "MPC_VELD_LP", "measurement",
        units="m/s to m/s²", span=span, note=note,
    )  # fmt: skip


VELOCITY = _velocity("MPC_XY_VEL", (1.2, 5.0), BOTH)
POSITION = FirmwareLoop("MPC_XY_P", units="m to m/s", span=(0.0, 2.0), note=BOTH)

LOOPS = {
    "roll rate": _rate("ROLL", (0.01, 0.5)),
    "pitch rate": _rate("PITCH", (0.01, 0.6)),
    "yaw rate": _rate("YAW", (0.0, 0.6)),
    "roll": _angle("ROLL"),
    "pitch": _angle("PITCH"),
    "yaw": _angle("YAW"),
    "north velocity": VELOCITY,
    "east velocity": VELOCITY,
    "north position": POSITION,
    "east position": POSITION,
    "vertical speed": _velocity("MPC_Z_VEL", (2.0, 15.0)),
    "altitude": FirmwareLoop("MPC_Z_P", units="m to m/s", span=(0.0, 1.5)),
}


def loops(version: tuple[int, ...] | None) -> dict[str, FirmwareLoop]:
    """The loops by name; no version has other names."""
    del version
    return LOOPS
