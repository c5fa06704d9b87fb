"""Navdata: the reports of the drone, UDP 5554.

A packet is a header, options and a checksum. Firmware versions add options and lengthen them; each
is read by the size it states. `Navdata.options` keeps the bytes of all options, so that a packet
that was read can be written again bit by bit; known fields overwrite those bytes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntFlag
from typing import Any, TypeAlias, get_args, get_type_hints

from deadtime.links._native import navdata_full, navdata_layouts, navdata_read, navdata_write
from deadtime.links.ardrone2.navdata_options import (
    AltitudeOption,
    Demo,
    KalmanPressure,
    PhysicalMeasures,
    Pressure,
    Pwm,
    RawMeasures,
    RcReferences,
    References,
    VideoStream,
    Wifi,
)

Options: TypeAlias = tuple[tuple[int, bytes], ...]

HEADER = 0x55667788

#: Every option of a full packet of 2190 bytes, all zero.
FULL_OPTIONS: Options = tuple((tag, bytes(length)) for tag, length in navdata_full())
#: The options of a short packet of 500 bytes, all zero: fields of `Demo` and the detections of the
#: camera.
DEMO_OPTIONS: Options = tuple(option for option in FULL_OPTIONS if option[0] in (0, 16))


class State(IntFlag):
    """Bits of `Navdata.state`."""

    FLYING = 1 << 0
    VIDEO = 1 << 1
    VISION = 1 << 2
    ANGULAR_RATE_CONTROL = 1 << 3
    ALTITUDE_CONTROL = 1 << 4
    USER_FEEDBACK = 1 << 5
    COMMAND_ACKNOWLEDGED = 1 << 6
    CAMERA_READY = 1 << 7
    TRAVELLING = 1 << 8
    USB = 1 << 9
    DEMO = 1 << 10
    BOOTSTRAP = 1 << 11
    MOTORS_PROBLEM = 1 << 12
    COMMUNICATION_LOST = 1 << 13
    SOFTWARE_FAULT = 1 << 14
    BATTERY_LOW = 1 << 15
    USER_EMERGENCY_LANDING = 1 << 16
    TIMER_ELAPSED = 1 << 17
    MAGNETOMETER_UNCALIBRATED = 1 << 18
    ANGLES_OUT_OF_RANGE = 1 << 19
    TOO_MUCH_WIND = 1 << 20
    ULTRASOUND_DEAF = 1 << 21
    CUTOUT = 1 << 22
    PIC_VERSION_OK = 1 << 23
    COMMAND_THREAD = 1 << 24
    NAVDATA_THREAD = 1 << 25
    VIDEO_THREAD = 1 << 26
    ACQUISITION_THREAD = 1 << 27
    CONTROL_WATCHDOG = 1 << 28
    ADC_WATCHDOG = 1 << 29
    COM_WATCHDOG = 1 << 30
    EMERGENCY = 1 << 31


def _bit(flag: State, says: str) -> property:
    bit = int(flag)

    def is_set(self: Navdata) -> bool:
        return bool(self.state & bit)

    return property(is_set, doc=says)


@dataclass(frozen=True)
class Navdata:
    """One packet of navdata.

    Attributes
    ----------
    state : int
        Bits of `State`; properties name the important ones.
    sequence : int
        Number of the packet, counted from 1 after a connection.
    vision : int
        Whether the detections of the camera are defined.
    clock : float, optional
        The drone's clock, s. It wraps after 2048 s; later times are written modulo 2048 s.
    demo, raw_measures, physical_measures, references, rc_references, pwm, altitude, \
video_stream, pressure, kalman_pressure, wifi
        The options whose fields are known, None where the packet does not contain them in full.
    options : tuple of (int, bytes)
        Tag and bytes of every option, the known ones among them, in the order of the packet. To
        build a packet of the drone's sizes give `FULL_OPTIONS` or `DEMO_OPTIONS`.
    header : int
        0x55667788; of some firmwares 0x55667789.
    checksum_matches : bool
        Whether the checksum of the packet that was read is that of its bytes.
    """

    state: int
    sequence: int
    vision: int = 0
    demo: Demo | None = None
    clock: float | None = None
    raw_measures: RawMeasures | None = None
    physical_measures: PhysicalMeasures | None = None
    references: References | None = None
    rc_references: RcReferences | None = None
    pwm: Pwm | None = None
    altitude: AltitudeOption | None = None
    video_stream: VideoStream | None = None
    pressure: Pressure | None = None
    kalman_pressure: KalmanPressure | None = None
    wifi: Wifi | None = None
    options: Options = ()
    header: int = HEADER
    checksum_matches: bool = True

    flying = _bit(State.FLYING, "In the air, from take-off until touch-down.")
    command_acknowledged = _bit(
        State.COMMAND_ACKNOWLEDGED, "A setting was received. The drone waits for ``Control(5)``."
    )
    demo_mode = _bit(State.DEMO, "Packets are short, and come 15 times per second.")
    bootstrap = _bit(State.BOOTSTRAP, "Not configured yet, so packets contain only a header.")
    motors_problem = _bit(State.MOTORS_PROBLEM, "A motor does not turn as it should.")
    communication_lost = _bit(State.COMMUNICATION_LOST, "No command was received for 2 s.")
    software_fault = _bit(State.SOFTWARE_FAULT, "The drone's program has failed.")
    battery_low = _bit(State.BATTERY_LOW, "The battery is sufficient only for landing.")
    angles_out_of_range = _bit(State.ANGLES_OUT_OF_RANGE, "Tilted too far.")
    too_much_wind = _bit(State.TOO_MUCH_WIND, "The wind is too strong.")
    ultrasound_deaf = _bit(State.ULTRASOUND_DEAF, "The height is lost.")
    cutout = _bit(State.CUTOUT, "The motors have been stopped.")
    com_watchdog = _bit(
        State.COM_WATCHDOG, "No command was received for 50 ms. This is information, not an alarm."
    )
    emergency = _bit(State.EMERGENCY, "The motors stay off until the emergency is ended.")

    @property
    def height(self) -> float | None:
        """Height, m."""
        return None if self.demo is None else self.demo.height

    @property
    def climb(self) -> float | None:
        """Vertical speed, m/s, up positive, where the packet says a finite one."""
        if self.kalman_pressure is not None:
            return _finite(self.kalman_pressure.est_zdot)
        return None if self.altitude is None else _finite(-self.altitude.altitude_vz)

    @property
    def climb_setpoint(self) -> float | None:
        """The vertical speed that the drone follows, m/s, up positive, where it says a finite one.

        The echo of the commands that have arrived.
        """
        return None if self.pwm is None else _finite(self.pwm.vz_ref)

    @property
    def roll(self) -> float | None:
        """Roll, rad, where the packet says a finite one."""
        return None if self.demo is None else _finite(self.demo.roll)

    @property
    def pitch(self) -> float | None:
        """Pitch, rad, where the packet says a finite one."""
        return None if self.demo is None else _finite(self.demo.pitch)

    @property
    def yaw(self) -> float | None:
        """Yaw, rad, where the packet says a finite one."""
        return None if self.demo is None else _finite(self.demo.yaw)

    @property
    def battery(self) -> int | None:
        """Charge left, percent."""
        return None if self.demo is None else self.demo.battery


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


#: Name and type of the fields that are options, by tag.
_FIELDS: dict[int, tuple[str, Any]] = {1: ("clock", float)} | {
    kind.tag: (name, kind)
    for name, annotation in get_type_hints(Navdata).items()
    for kind in get_args(annotation)
    if hasattr(kind, "tag")
}
#: Tags of the options with known fields, by their names in `Navdata`.
TAGS = {name: tag for tag, (name, _) in _FIELDS.items()}
_LENGTHS = {layout.tag: layout.length for layout in navdata_layouts()}


def parse_navdata(packet: bytes, *, checksum: bool = True) -> Navdata:
    """Read a packet of navdata.

    If an option occurs twice, the first one is used.

    Parameters
    ----------
    packet : bytes
        One datagram.
    checksum : bool, optional
        Refuse a packet whose checksum does not match; otherwise see `Navdata.checksum_matches`.

    Raises
    ------
    PacketError
        If it has more than 8192 bytes, its header is another one, an option is smaller than its
        own head or ends beyond the packet, or the checksum is missing, wrong or not the last
        option.

    Examples
    --------
    >>> sent = Navdata(State.FLYING | State.DEMO, 7, demo=Demo(major=3, battery=80, height=1.25))
    >>> packet = build_navdata(sent)
    >>> parse_navdata(packet).height
    1.25
    >>> parse_navdata(packet[:-8])
    Traceback (most recent call last):
    deadtime._base.errors.PacketError: navdata: the last option is not a checksum, at byte 164
    """
    read = navdata_read(packet, checksum)
    known: dict[str, Any] = {}
    options = []
    for option in read.options:
        tag, values = option.tag, option.values
        options.append((tag, option.body))
        if tag in _FIELDS and _FIELDS[tag][0] not in known:
            name, kind = _FIELDS[tag]
            known[name] = None if values is None else kind(*values)
    return Navdata(
        state=read.state,
        sequence=read.sequence,
        vision=read.vision,
        options=tuple(options),
        header=read.header,
        checksum_matches=read.checksum_matches,
        **known,
    )


def build_navdata(navdata: Navdata) -> bytes:
    """Write a packet of navdata with its checksum.

    The options of `navdata.options` come first and in their order, with the known fields written
    over their bytes; then, by tag, those that are only in fields. None leaves bytes as they are.

    Raises
    ------
    ValueError
        If a value is not finite or has no place on the wire, or the packet has more than 8192
        bytes.
    """
    fields = {
        tag: (value,) if tag == 1 else tuple(vars(value).values())
        for tag, (name, _) in _FIELDS.items()
        if (value := getattr(navdata, name)) is not None
    }
    options: list[tuple[int, bytes, tuple[float, ...] | None]] = [
        (tag, body, fields.pop(tag, None)) for tag, body in navdata.options
    ]
    options += [(tag, bytes(_LENGTHS[tag]), fields[tag]) for tag in sorted(fields)]
    head = {name: getattr(navdata, name) for name in ("header", "state", "sequence", "vision")}
    try:
        return navdata_write(options, **head)
    except OverflowError as error:
        raise ValueError(f"a word of the header {head}, or a tag, is not valid: {error}") from None
