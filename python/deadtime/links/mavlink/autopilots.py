"""What ArduPilot and PX4 do differently: modes, failsafes, parameters, take-off.

ArduPilot Copter is flown in the tests; PX4 stands here as its documentation has it and is tested
against frames and a stand-in only.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.codec import dialect
from deadtime.links.mavlink.parameters import Parameters
from deadtime.links.mavlink.points import Kind
from deadtime.links.safety import Limits

#: Longest time for which the vehicle follows an old set point, s.
SILENCE = 0.5

#: Time without heartbeats after which ArduPilot lands, s: the least that it accepts.
HEARTBEATS_LOST = 2.0


#: Bits of FENCE_TYPE: a largest height, a circle, a least height.
FENCE_TOP, FENCE_CIRCLE, FENCE_BOTTOM = 1, 2, 8

#: The bit of GUID_OPTIONS by which ArduPilot takes a thrust for a thrust.
THRUST_AS_THRUST = 8


def _numbered(first: int, names: str) -> dict[int, str]:
    return dict(enumerate(names.split(), first))


#: Names of modes: ``custom_mode`` of ArduPilot Copter; main modes of PX4, and those of its AUTO.
COPTER_MODES = _numbered(
    0,
    "STABILIZE ACRO ALT_HOLD AUTO GUIDED LOITER RTL CIRCLE POSITION LAND OF_LOITER DRIFT - SPORT "
    "FLIP AUTOTUNE POSHOLD BRAKE THROW AVOID_ADSB GUIDED_NOGPS SMART_RTL FLOWHOLD FOLLOW ZIGZAG "
    "SYSTEMID AUTOROTATE AUTO_RTL TURTLE",
)
PX4_MODES = _numbered(1, "MANUAL ALTCTL POSCTL AUTO ACRO OFFBOARD STABILIZED RATTITUDE")
PX4_AUTO_MODES = _numbered(1, "READY TAKEOFF LOITER MISSION RTL LAND")


class Scaled(NamedTuple):
    """A parameter, and the factor from it to SI units."""

    name: str
    factor: float


class Speed(NamedTuple):
    """A parameter of a speed, the factor to m/s, its least value, and the limit that it keeps."""

    name: str
    factor: float
    least: float
    limit: str


class Autopilot(ABC):
    """Conventions of one firmware.

    Attributes
    ----------
    name : str
    guided, landing : int
        ``custom_mode`` in which set points are followed, and in which it lands.
    arming : int
        Mode in which it is armed. Where it is not `guided`, that is entered after the take-off, and
        only while set points are sent.
    rising : tuple of int
        Modes that it may have while it takes off.
    integers_as_bits : bool
        Whether the float of a parameter carries the bits of an integer, not the number.
    estimator : str
        Message with the flags of its position estimate.
    simulated : str or None
        A parameter that its simulator has and vehicles have not.
    echoes : bool
        Whether it reports the set points that it follows as they were sent.
    shaping : mapping of str to (Scaled, Scaled or None)
        The parameters that limit the change of a commanded rate, and the change of that, by axis.
    speeds : tuple of Speed
        The parameters that limit the speed towards a position.
    """

    name: ClassVar[str]
    guided: ClassVar[int]
    landing: ClassVar[int]
    arming: ClassVar[int]
    rising: ClassVar[tuple[int, ...]]
    integers_as_bits: ClassVar[bool]
    estimator: ClassVar[str]
    simulated: ClassVar[str | None] = None
    echoes: ClassVar[bool] = False
    shaping: ClassVar[Mapping[str, tuple[Scaled, Scaled | None]]] = {}
    speeds: ClassVar[tuple[Speed, ...]] = ()

    async def allow(self, parameters: Parameters, limits: Limits, kind: Kind) -> None:
        """Plan what set points of a kind need: speeds towards a position, the sense of a thrust.

        Raises
        ------
        LinkError
            If it does not answer for a setting.
        """
        for speed in self.speeds if kind == "position" else ():
            most = max(speed.least, getattr(limits, speed.limit) / speed.factor)
            await _at_most(parameters, most, speed.name)

    @abstractmethod
    def mode(self, custom: int) -> tuple[float, ...]:
        """Parameters of MAV_CMD_DO_SET_MODE."""

    @abstractmethod
    def mode_name(self, custom: int) -> str:
        """A mode in words."""

    @abstractmethod
    def take_off(self, height: float, position: Any) -> tuple[float, ...]:
        """Parameters of MAV_CMD_NAV_TAKEOFF; `position` is the GLOBAL_POSITION_INT or None."""

    @abstractmethod
    async def set_limits(self, parameters: Parameters, limits: Limits, system: int) -> float:
        """Plan limits and failsafes; return the time for which it follows an old set point, s.

        Raises
        ------
        LinkError
            If it does not answer for one of them, or the limits reach beyond its own fence.
        """


class ArduPilot(Autopilot):
    """ArduPilot Copter: GUIDED. Its parameters are numbers, also the integers."""

    name = "ArduPilot"
    guided, landing, arming = 4, 9, 4
    rising = (4,)
    integers_as_bits = False
    estimator = "EKF_STATUS_REPORT"
    simulated = "SIM_SPEEDUP"
    echoes = True
    shaping: ClassVar[Mapping[str, tuple[Scaled, Scaled | None]]] = {
        "z": (Scaled("WPNAV_ACCEL_Z", 0.01), Scaled("PSC_JERK_Z", 1.0)),
        **{axis: (Scaled("WPNAV_ACCEL", 0.01), Scaled("PSC_JERK_XY", 1.0)) for axis in ("x", "y")},
        "yaw": (Scaled("ATC_ACCEL_Y_MAX", math.radians(0.01)), None),
    }

    speeds = (
        Speed("WPNAV_SPEED", 0.01, 20.0, "max_speed"),
        Speed("WPNAV_SPEED_UP", 0.01, 10.0, "max_climb"),
        Speed("WPNAV_SPEED_DN", 0.01, 10.0, "max_climb"),
    )

    async def allow(self, parameters: Parameters, limits: Limits, kind: Kind) -> None:
        """Thrust is a thrust: without this option it is a rate of climb (GUID_OPTIONS)."""
        await super().allow(parameters, limits, kind)
        if kind == "position":
            return
        held = await parameters.read("GUID_OPTIONS")
        if held is None:
            raise LinkError("the vehicle does not report its parameter GUID_OPTIONS")
        await parameters.plan("GUID_OPTIONS", float(int(held) | THRUST_AS_THRUST))

    def mode(self, custom: int) -> tuple[float, ...]:
        """As in `Autopilot`."""
        return 1.0, float(custom)

    def mode_name(self, custom: int) -> str:
        """As in `Autopilot`."""
        return COPTER_MODES.get(custom, f"mode {custom}")

    def take_off(self, height: float, position: Any) -> tuple[float, ...]:
        """Above home, where it was armed."""
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height

    async def set_limits(self, parameters: Parameters, limits: Limits, system: int) -> float:
        """Set points expire, lost heartbeats land it, the fence is above `max_height`.

        The fence keeps a distance of FENCE_MARGIN to its top, and what an old set point climbs is
        added. Fence and tilt are only made stricter.
        """
        station = await parameters.read("SYSID_MYGCS")
        if station is None:
            station = await parameters.read("MAV_GCS_SYSID")  # its name since 4.7
        if station is None:
            raise LinkError("the vehicle does not report its parameter SYSID_MYGCS")
        if station != system:
            raise LinkError(
                f"the vehicle expects heartbeats of system {station:g} (SYSID_MYGCS), but this "
                f"program is system {system}: connect as system {station:g}, or change the "
                "parameter"
            )
        kinds, fenced = await parameters.read("FENCE_TYPE"), await parameters.read("FENCE_ENABLE")
        if kinds is None or fenced is None:
            raise LinkError(
                "the vehicle does not report the parameters of its fence (FENCE_TYPE, FENCE_ENABLE)"
            )
        own = int(kinds) if fenced else 0
        await self._check_fence(parameters, limits, own)
        silence = await _at_most(parameters, SILENCE, "GUID_TIMEOUT")
        await parameters.plan("FS_GCS_TIMEOUT", HEARTBEATS_LOST)
        await parameters.plan("FS_GCS_ENABLE", 5.0)  # always land
        margin = await parameters.read("FENCE_MARGIN") or 0.0
        top = limits.max_height + limits.max_climb * silence + margin
        if own & FENCE_TOP:
            await _at_most(parameters, top, "FENCE_ALT_MAX")
        else:
            await parameters.plan("FENCE_ALT_MAX", top)
        await parameters.plan("FENCE_TYPE", float(own | FENCE_TOP))
        await parameters.plan("FENCE_ACTION", 2.0)  # land; the default climbs and returns
        await parameters.plan("FENCE_ENABLE", 1.0)
        degrees = max(10.0, math.degrees(limits.max_angle))
        if await parameters.read("ANGLE_MAX") is not None:
            await _at_most(parameters, 100.0 * degrees, "ANGLE_MAX")
        else:
            await _at_most(parameters, degrees, "ATC_ANGLE_MAX")  # its name since 4.7
        return silence

    async def _check_fence(self, parameters: Parameters, limits: Limits, kinds: int) -> None:
        """Refuse limits that reach beyond the vehicle's own fence: it would land in the middle."""
        if kinds & FENCE_TOP:
            await _reaches(parameters, "FENCE_ALT_MAX", "max_height", _highest(limits))
        if kinds & FENCE_CIRCLE:
            await _reaches(parameters, "FENCE_RADIUS", "max_distance", limits.max_distance)
        if kinds & FENCE_BOTTOM:
            low = await parameters.read("FENCE_ALT_MIN")
            if low is not None and low > limits.min_height:
                raise LinkError(
                    f"the vehicle's own fence begins at {low:g} m (FENCE_ALT_MIN), but "
                    f"min_height = {limits.min_height:g} m is below: give a larger min_height, "
                    "or lower the fence"
                )


class PX4(Autopilot):
    """PX4: Offboard. Its parameters of integers carry their bits in the float."""

    name = "PX4"
    guided, landing, arming = 6 << 16, 4 << 16 | 6 << 24, 4 << 16 | 3 << 24
    rising = (4 << 16 | 2 << 24, 4 << 16 | 3 << 24)  # AUTO.TAKEOFF, then AUTO.LOITER
    integers_as_bits = True
    estimator = "ESTIMATOR_STATUS"
    speeds = (
        Speed("MPC_XY_VEL_MAX", 1.0, 0.0, "max_speed"),
        Speed("MPC_Z_VEL_MAX_UP", 1.0, 0.5, "max_climb"),
        Speed("MPC_Z_VEL_MAX_DN", 1.0, 0.5, "max_climb"),
    )

    def mode(self, custom: int) -> tuple[float, ...]:
        """As in `Autopilot`."""
        return 1.0, float(custom >> 16 & 0xFF), float(custom >> 24)

    def mode_name(self, custom: int) -> str:
        """As in `Autopilot`."""
        main, sub = custom >> 16 & 0xFF, custom >> 24
        name = PX4_MODES.get(main, f"mode {main}")
        return f"AUTO.{PX4_AUTO_MODES.get(sub, str(sub))}" if name == "AUTO" else name

    def take_off(self, height: float, position: Any) -> tuple[float, ...]:
        """Above the sea; where it stands, as it is turned."""
        if position is None:
            raise LinkError("the vehicle sends no GLOBAL_POSITION_INT, so its altitude is unknown")
        here = math.nan
        return 0.0, 0.0, 0.0, here, here, here, 1e-3 * position.alt + height

    async def set_limits(self, parameters: Parameters, limits: Limits, system: int) -> float:
        """Without set points it holds, without heartbeats it lands; the fence lands it too."""
        await _reaches(parameters, "GF_MAX_VER_DIST", "max_height", _highest(limits))
        await _reaches(parameters, "GF_MAX_HOR_DIST", "max_distance", limits.max_distance)
        silence = await _at_most(parameters, SILENCE, "COM_OF_LOSS_T")
        await parameters.plan("COM_OBL_RC_ACT", 5.0)  # hold
        await parameters.plan("COM_DL_LOSS_T", 5.0)  # s, the least that it accepts
        await parameters.plan("NAV_DLL_ACT", 3.0)  # land
        await _at_most(
            parameters, limits.max_height + limits.max_climb * silence, "GF_MAX_VER_DIST"
        )
        await parameters.plan("GF_ACTION", 5.0)  # land
        degrees = max(20.0, math.degrees(limits.max_angle))
        await _at_most(parameters, degrees, "MPC_TILTMAX_AIR")
        return silence


def _highest(limits: Limits) -> float:
    """The height that a vehicle may reach, m: the largest, and what an old set point climbs."""
    return limits.max_height + limits.max_climb * SILENCE


async def _reaches(parameters: Parameters, name: str, limit: str, needed: float) -> None:
    """Refuse a fence of the vehicle's own that is closer than a limit needs; 0 is none."""
    held = await parameters.read(name)
    if held is not None and 0.0 < held < needed:
        raise LinkError(
            f"the vehicle's own fence is at {held:g} m ({name}), but this flight may reach "
            f"{needed:g} m: give a smaller {limit}, or a wider fence"
        )


async def _at_most(parameters: Parameters, most: float, name: str) -> float:
    """Lower a parameter to a value, if it is higher; return what holds."""
    held = await parameters.read(name)
    if held is None:
        raise LinkError(f"the vehicle does not report its parameter {name}")
    if 0.0 < held <= most:
        parameters.kept[name] = held
        return held
    await parameters.plan(name, most)
    return most


def autopilot_of(heartbeat: Any) -> Autopilot:
    """The conventions of the firmware that sends a heartbeat.

    Raises
    ------
    LinkError
        If it is another one, or the vehicle no multicopter.
    """
    d = dialect()
    if heartbeat.type not in COPTERS:
        raise LinkError(
            f"the vehicle has the type {heartbeat.type} (MAV_TYPE), but only multicopters can "
            "be flown"
        )
    if heartbeat.autopilot == d.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return ArduPilot()
    if heartbeat.autopilot == d.MAV_AUTOPILOT_PX4:
        return PX4()
    raise LinkError(
        f"the autopilot has the number {heartbeat.autopilot}, but only ArduPilot (3) and PX4 "
        "(12) can be flown"
    )


#: MAV_TYPE of quadrotor, coaxial, hexarotor, octorotor, tricopter, and decarotor/dodecarotor.
COPTERS = (2, 3, 13, 14, 15, 29, 35)
