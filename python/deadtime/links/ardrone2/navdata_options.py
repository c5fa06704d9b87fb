"""The options of navdata with known fields, in SI units, with the signs and names of the drone.

The fields stand in the order of the native tables, which say where in the bytes they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Demo:
    """The option of every packet after the handshake.

    Attributes
    ----------
    minor, major : int
        Control state and its detail; major 2: landed, 3: flying, 4: hovering, 6: taking off, 7: on
        the way to its place after take-off, 8: landing.
    battery : int
        Percent.
    pitch, roll, yaw : float
        rad.
    height : float
        m, to the millimetre; below zero at times.
    vx, vy, vz : float
        m/s; the vertical one is always 0 on this drone.
    frame : int
        Number of the video's frame.
    """

    tag: ClassVar[int] = 0
    minor: int = 0
    major: int = 0
    battery: int = 0
    pitch: float = 0.0
    roll: float = 0.0
    yaw: float = 0.0
    height: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    frame: int = 0


@dataclass(frozen=True)
class RawMeasures:
    """Sensors, in counts; `battery_voltage` in mV, `height` of the ultrasound in m."""

    tag: ClassVar[int] = 2
    acceleration_x: int = 0
    acceleration_y: int = 0
    acceleration_z: int = 0
    rate_x: int = 0
    rate_y: int = 0
    rate_z: int = 0
    slow_rate_x: int = 0
    slow_rate_y: int = 0
    battery_voltage: int = 0
    height: float = 0.0
    gradient: int = 0


@dataclass(frozen=True)
class PhysicalMeasures:
    """Accelerations in units of the standard gravity, rates in rad/s, temperatures in counts."""

    tag: ClassVar[int] = 3
    acceleration_temperature: float = 0.0
    gyro_temperature: int = 0
    acceleration_x: float = 0.0
    acceleration_y: float = 0.0
    acceleration_z: float = 0.0
    rate_x: float = 0.0
    rate_y: float = 0.0
    rate_z: float = 0.0


@dataclass(frozen=True)
class References:
    """References of the drone: `ui_theta` and `ui_phi` echo the commanded motion.

    `ui_time` is the word of the drone's clock as a number, and no time of a command; `ui_seq` is
    0 on this drone.
    """

    tag: ClassVar[int] = 6
    ref_theta: int = 0
    ref_phi: int = 0
    ui_time: float = 0.0
    ui_theta: float = 0.0
    ui_phi: float = 0.0
    ui_psi: float = 0.0
    ui_psi_accuracy: float = 0.0
    ui_seq: int = 0


@dataclass(frozen=True)
class RcReferences:
    """References of a remote control; all 0 on this drone."""

    tag: ClassVar[int] = 8
    pitch: int = 0
    roll: int = 0
    yaw: int = 0
    gaz: int = 0
    ag: int = 0


@dataclass(frozen=True)
class Pwm:
    """Motors (of 255), parts of their command, and the vertical speed that the drone follows.

    Attributes
    ----------
    vz_ref : float
        m/s, up positive: the echo of the climb that was commanded.
    """

    tag: ClassVar[int] = 9
    motor1: int = 0
    motor2: int = 0
    motor3: int = 0
    motor4: int = 0
    gaz_feed_forward: float = 0.0
    gaz_altitude: float = 0.0
    altitude_integral: float = 0.0
    vz_ref: float = 0.0


@dataclass(frozen=True)
class AltitudeOption:
    """Height by camera and ultrasound.

    Attributes
    ----------
    altitude_vision, altitude_ref : float
        m.
    altitude_vz : float
        Vertical speed, m/s, **down** positive.
    altitude_raw : float
        Height of the ultrasound, m; new every 40 ms.
    """

    tag: ClassVar[int] = 10
    altitude_vision: float = 0.0
    altitude_vz: float = 0.0
    altitude_ref: float = 0.0
    altitude_raw: float = 0.0


@dataclass(frozen=True)
class VideoStream:
    """The video that is sent, and `atcmd_ref_seq`: the number of the last `Ref` received."""

    tag: ClassVar[int] = 19
    quantiser: int = 0
    frame_size: int = 0
    frame: int = 0
    atcmd_ref_seq: int = 0
    atcmd_mean_gap: int = 0


@dataclass(frozen=True)
class Pressure:
    """The barometer: counts, tenths of a degree Celsius, Pa."""

    tag: ClassVar[int] = 21
    raw_pressure: int = 0
    raw_temperature: int = 0
    temperature: int = 0
    pressure: int = 0


@dataclass(frozen=True)
class KalmanPressure:
    """Height `est_z` in m and vertical speed `est_zdot` in m/s, up positive, filtered on board."""

    tag: ClassVar[int] = 24
    offset_pressure: float = 0.0
    est_z: float = 0.0
    est_zdot: float = 0.0


@dataclass(frozen=True)
class Wifi:
    """The wireless link, as the drone has it."""

    tag: ClassVar[int] = 26
    link_quality: int = 0
