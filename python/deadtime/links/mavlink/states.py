"""`VehicleState` from the messages of a vehicle."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

from deadtime.links.mavlink.belief import AGREEING, Belief
from deadtime.links.mavlink.codec import dialect
from deadtime.links.vehicle import Echo, VehicleState

#: MAV_LANDED_STATE.
UNKNOWN, ON_GROUND, IN_AIR = 0, 1, 2

#: Flags of a position estimate: horizontal and vertical position absolute; bit 7 is "constant".
ESTIMATED, CONSTANT = 16 | 32, 128

#: Age beyond which a report is not news any more, s: heartbeats come once a second at least.
NEWS = 2.5

#: Frames are numbered up to this.
NUMBERS = 256

#: Time over which lost frames are looked at, s.
RECENT = 1.0

#: A clock that is set back by more than this, s, has begun anew.
RESTARTED = 5.0

#: Longest time over which a heading is continued by its rate, s.
OLDEST = 0.1

#: Rate of the messages that come most often, 1/s, and the bits a second of a serial link that it
#: takes: 8000 bytes a second with all others, of which it has room for 80 %.
OFTEN, ENOUGH = 50.0, 100_000

#: Fields of LOCAL_POSITION_NED and of ATTITUDE.
POSITION = ("x", "y", "z", "vx", "vy", "vz")
ANGLES = ("roll", "pitch", "yaw", "yawspeed")

#: Flags of MAV_MODE_FLAG and values of MAV_STATE.
ARMED, CRITICAL, EMERGENCY, TERMINATED = 128, 5, 6, 8


class StateReader:
    """Collects the state of one vehicle; each LOCAL_POSITION_NED completes one.

    Heights are above the place where the vehicle last stood: ArduPilot moves the zero of its
    positions when it is armed.

    Attributes
    ----------
    newest : VehicleState or None
    arming, modes, landing, estimate : Belief
        What heartbeats say of whether it is armed and of its ``custom_mode``, its MAV_LANDED_STATE,
        and whether it knows its position.
    echo : Echo or None
        The newest echo of the commands.
    ground : float
        Down coordinate of the ground, m, from which heights count.
    """

    def __init__(self, estimator: str = "") -> None:
        self.estimator = estimator
        self.newest: VehicleState | None = None
        self.arming: Belief[bool] = Belief()
        self.modes: Belief[int] = Belief()
        self.landing: Belief[int] = Belief()
        self.estimate: Belief[bool] = Belief()
        self.echo: Echo | None = None
        self.ground = 0.0
        self._status: Belief[int] = Belief()
        self._batteries: deque[float] = deque(maxlen=AGREEING)
        self._attitudes: deque[Any] = deque(maxlen=AGREEING)
        self._lifted: Belief[bool] = Belief()
        self._flown = False
        self._time = -math.inf
        self._frames = 0
        self._sequence: int | None = None
        self._ahead: int | None = None
        self._gaps: deque[tuple[float, int]] = deque()

    @property
    def armed(self) -> bool | None:
        """Whether it is armed, by messages that agree."""
        return self.arming.value

    @property
    def mode(self) -> int | None:
        """Its ``custom_mode``, by messages that agree."""
        return self.modes.value

    @property
    def landed_state(self) -> int:
        """Its MAV_LANDED_STATE, by messages that agree."""
        return UNKNOWN if self.landing.value is None else self.landing.value

    @property
    def ready(self) -> bool:
        """Whether it knows its position, by messages that agree."""
        return bool(self.estimate.value)

    @property
    def is_on_ground(self) -> bool:
        """Whether the newest messages make sure that it is on the ground, armed or not."""
        return self._time - self.landing.heard < NEWS and self.landing.is_sure(ON_GROUND)

    @property
    def is_down(self) -> bool:
        """Whether the newest messages make sure that it is disarmed on the ground."""
        is_news = self._time - self.arming.heard < NEWS
        return is_news and self.arming.is_sure(False) and self.is_on_ground

    def count_anew(self) -> None:
        """Count frames of another link, which has numbers of its own."""
        self._sequence = self._ahead = None

    def take(self, message: Any, time: float) -> VehicleState | None:
        """Take a message that arrived at a time, s; return the state that it completes."""
        self._time = time
        self._count(message.get_seq(), time)
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.modes.take(int(message.custom_mode), time)
            self.arming.take(bool(message.base_mode & ARMED), time)
            self._status.take(int(message.system_status), time)
        elif kind == "EXTENDED_SYS_STATE":
            self.landing.take(int(message.landed_state), time)
            self._lifted.take(message.landed_state not in (UNKNOWN, ON_GROUND), time)
        elif kind == "ATTITUDE":
            self._attitudes.append(message)
        elif kind == "SYS_STATUS" and message.battery_remaining >= 0:
            self._batteries.append(float(message.battery_remaining))
        elif kind == "POSITION_TARGET_LOCAL_NED":
            self._take_echo(echo_of(message, time))
        elif kind == self.estimator:
            flags = int(message.flags)
            self.estimate.take(flags & ESTIMATED == ESTIMATED and not flags & CONSTANT, time)
        elif kind == "LOCAL_POSITION_NED":
            return self._complete(message, time)
        return None

    def _take_echo(self, echo: Echo) -> None:
        """Take an echo, unless a newer one has overtaken it."""
        before = -math.inf if self.echo is None else self.echo.vehicle_time
        if not before - RESTARTED < echo.vehicle_time < before:
            self.echo = echo

    def _count(self, sequence: int, time: float) -> None:
        """Count frames and gaps.

        An old frame that comes late is none; numbers begin anew after 255, so that it may seem to
        be far ahead. A gap counts once the next frame continues behind it.
        """
        self._frames += 1
        if self._sequence is None:
            self._sequence = sequence
        passed = (sequence - self._sequence) % NUMBERS
        if passed > 1 and self._ahead is not None:
            beyond = (sequence - self._ahead) % NUMBERS
            if 0 < beyond <= NUMBERS // 2:
                lost = (self._ahead - self._sequence) % NUMBERS - 1
                self._gaps.append((time, lost))
                self._frames += lost
                self._sequence, passed = self._ahead, beyond
        if passed == 1:
            self._sequence, self._ahead = sequence, None
        elif 1 < passed <= NUMBERS // 2:
            self._ahead = sequence
        while self._gaps and self._gaps[0][0] < time - RECENT:
            self._gaps.popleft()

    def _complete(self, message: Any, time: float) -> VehicleState | None:
        stamp = 1e-3 * message.time_boot_ms
        before = self.newest
        restarted = before is not None and stamp < (before.vehicle_time or 0.0) - RESTARTED
        if self.armed is None or self.landed_state == UNKNOWN:
            return None
        if before is not None and stamp <= (before.vehicle_time or 0.0) and not restarted:
            return None  # a copy, or overtaken by a newer one
        x, y, z, vx, vy, vz = (float(getattr(message, name)) for name in POSITION)
        if not all(map(math.isfinite, (x, y, z, vx, vy, vz))):
            return None
        self._find_ground(z)
        turned = self._attitude
        self.newest = VehicleState(
            time=time,
            height=self.ground - z,
            flying=self.armed and self.landed_state == IN_AIR,
            landed=not self.armed and self.landed_state == ON_GROUND,
            sequence=self._frames,
            vehicle_time=stamp,
            climb=-vz,
            roll=0.0 if turned is None else float(turned.roll),
            pitch=0.0 if turned is None else float(turned.pitch),
            yaw=None if turned is None else _heading(turned, stamp),
            yaw_rate=None if turned is None else _finite(turned.yawspeed),
            north=x,
            east=y,
            north_speed=vx,
            east_speed=vy,
            climb_setpoint=None if self.echo is None else self.echo.up,
            north_setpoint=None if self.echo is None else self.echo.north,
            east_setpoint=None if self.echo is None else self.echo.east,
            battery=max(self._batteries, default=None),
            emergency=self._emergency,
            fault=self._fault,
            missing=max((lost for _, lost in self._gaps), default=0),
        )
        return self.newest

    def _find_ground(self, down: float) -> None:
        """Count heights from where it stands, and not from where it flies."""
        if self.armed and self._lifted.is_sure(True):
            self._flown = True
        elif self.is_down:
            self._flown = False
        if self.landed_state == self.landing.newest == ON_GROUND and not self._flown:
            self.ground = down

    @property
    def _attitude(self) -> Any:
        """The newest attitude; one that is not finite counts only after another such one."""
        finite = [attitude for attitude in self._attitudes if _is_finite(attitude)]
        return (finite or [*self._attitudes, None])[-1]

    @property
    def _fault(self) -> str | None:
        if self.has_lost_position:
            return "its position estimate is lost"
        return "a failsafe of its own is active" if self._status.value == CRITICAL else None

    @property
    def has_lost_position(self) -> bool:
        """Whether it has flown, and does not know its position any more."""
        return self._flown and self.estimate.is_sure(False)

    @property
    def _emergency(self) -> bool:
        off = self.armed is False and self.landed_state == IN_AIR
        return off or self._status.value in (EMERGENCY, TERMINATED)


def _is_finite(attitude: Any) -> bool:
    return all(math.isfinite(getattr(attitude, name)) for name in ANGLES)


def _heading(attitude: Any, stamp: float) -> float | None:
    """The heading at a time of the vehicle, s, by its rate: the attitude is up to a period old."""
    if not (math.isfinite(attitude.yaw) and math.isfinite(attitude.yawspeed)):
        return None
    passed = stamp - 1e-3 * attitude.time_boot_ms
    turned = float(attitude.yaw) + float(attitude.yawspeed) * min(max(passed, 0.0), OLDEST)
    return math.remainder(turned, 2.0 * math.pi)


def echo_of(message: Any, time: float) -> Echo:
    """What a POSITION_TARGET_LOCAL_NED that arrived at a time, s, says."""
    speeds = (_finite(speed) for speed in (message.vx, message.vy, -message.vz))
    return Echo(time, 1e-3 * message.time_boot_ms, *speeds)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def wanted_messages(estimator: str, baud: int | None = None) -> dict[str, tuple[int, float]]:
    """The messages that are asked for: number, and rate in 1/s.

    On a serial link of few bits a second those that come often come less often.
    """
    d = dialect()
    often = OFTEN if baud is None else OFTEN * min(1.0, baud / ENOUGH)
    rates = {
        "LOCAL_POSITION_NED": often,
        "POSITION_TARGET_LOCAL_NED": often,
        "ATTITUDE": often,
        "EXTENDED_SYS_STATE": 10.0,
        "HEARTBEAT": 10.0,
        "SYS_STATUS": 2.0,
        "GLOBAL_POSITION_INT": 2.0,
        estimator: 4.0,
    }
    return {name: (getattr(d, f"MAVLINK_MSG_ID_{name}"), rate) for name, rate in rates.items()}
