"""From navdata packets to states of the vehicle, believing no more of them than one can.

A packet counts if its checksum holds, its sequence number is above the last one by no more than the
time that has passed allows, the drone's clock does not run backwards and its height has not jumped.
Numbers begin anew only when the drone says that it is in bootstrap, or that it had lost its
client and nothing was heard of it for a while: then its configuration is no longer ours, which
whoever holds the link is told.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

from deadtime._base.errors import PacketError
from deadtime.links.ardrone2.navdata import Navdata, State, parse_navdata
from deadtime.links.safety import jumps
from deadtime.links.vehicle import VehicleState

__all__ = [
    "FLYING",
    "HOVERING",
    "LinkStatistics",
    "NavdataReader",
    "on_ground",
    "phase_of",
    "unasked_end",
]

#: The drone's clock counts its seconds in 11 bits.
CLOCK_TURN = 2048.0

#: Packets a second that are believed, with room for a burst: the drone sends 200.
MOST_PACKETS, BURST = 1000.0, 100

#: How long nothing is heard before numbers may begin anew after a com watchdog, s.
SILENCE = 0.5

#: How long a state tells of messages that were lost, s.
RECENT = 1.0

#: Control states, the upper half of the word that navdata has for them.
FLYING, HOVERING = 3, 4
TAKING_OFF, CLIMBING, LANDING = 6, 7, 8


#: Bits of the drone's state with which it is not to be flown on, as of `VehicleState.fault`.
FAULTS = {
    State.ULTRASOUND_DEAF: "its ultrasound is deaf",
    State.MOTORS_PROBLEM: "a motor does not turn as it should",
    State.CUTOUT: "its motors have been stopped",
    State.ANGLES_OUT_OF_RANGE: "it is tilted too far",
    State.SOFTWARE_FAULT: "its program has failed",
    State.TOO_MUCH_WIND: "there is more wind than it can hold against",
    State.BATTERY_LOW: "its battery lasts for no more than landing",
}


@dataclass(frozen=True)
class LinkStatistics:
    """What came over the link.

    Attributes
    ----------
    packets : int
        All that arrived from the drone's address.
    states : int
        Those that were believed and hold a state.
    missing : int
        Numbers that were left out and have not come later.
    duplicates, reordered : int
        Repeated ones, and ones that came after a later one; neither is used.
    broken : int
        Not navdata, cut short, or with a wrong checksum.
    implausible : int
        With a sequence number, a clock or a height that cannot be.
    foreign : int
        From another address or port.
    restarts : int
        How often the drone began to count anew.
    longest_gap : float
        Longest time between two states, s.
    rate : float
        States a second.
    """

    packets: int = 0
    states: int = 0
    missing: int = 0
    duplicates: int = 0
    reordered: int = 0
    broken: int = 0
    implausible: int = 0
    foreign: int = 0
    restarts: int = 0
    longest_gap: float = 0.0
    rate: float = 0.0


class NavdataReader:
    """Reads the packets of one drone, in the order in which they arrive.

    Parameters
    ----------
    max_jump : float
        Fastest change of the height that is believed, m/s.

    Attributes
    ----------
    newest : VehicleState or None
        The newest state.
    navdata : Navdata or None
        The packet it is from; also one of bootstrap, which holds no state.
    heard : float or None
        When the last believed packet arrived, s.
    sent : float or None
        When that packet was sent, s: by the drone's clock, set by the packet that took the shortest
        way. It is later than the truth by the length of that way, which cannot be measured from one
        end. None where the packet does not tell the drone's clock.
    restarts : int
        How often the drone began to count anew.
    """

    def __init__(self, max_jump: float = 5.0) -> None:
        self.max_jump = max_jump
        self.newest: VehicleState | None = None
        self.navdata: Navdata | None = None
        self.heard: float | None = None
        self.sent: float | None = None
        self.restarts = 0
        self._counts = LinkStatistics()
        self._first: float | None = None
        self._clock: float | None = None
        self._least_ahead = math.inf
        self._lost: deque[tuple[float, int]] = deque()

    @property
    def statistics(self) -> LinkStatistics:
        """What came until now."""
        rate = 0.0
        if self._first is not None and self.newest is not None and self.newest.time > self._first:
            rate = (self._counts.states - 1) / (self.newest.time - self._first)
        return replace(self._counts, restarts=self.restarts, rate=rate)

    def refuse(self) -> None:
        """Count a packet from elsewhere."""
        self._count(foreign=1)

    def accept(self, packet: bytes, now: float) -> VehicleState | None:
        """Take a packet in.

        Parameters
        ----------
        packet : bytes
            As it arrived.
        now : float
            When, s.

        Returns
        -------
        VehicleState or None
            The state it tells, which is then `newest`; None if it tells none or is not believed.
        """
        self._count(packets=1)
        try:
            navdata = parse_navdata(packet)
        except PacketError:
            self._count(broken=1)
            return None
        last = None if self.navdata is None else self.navdata.sequence
        if last is not None and not self._follows(navdata, last, now):
            return None
        if navdata.demo is None:
            self.navdata, self.heard, self.sent = navdata, now, None
            return None
        clock = self._unwrapped(navdata.clock)
        passed = self._passed(clock, now)
        if passed is None or self._jumps(navdata, passed):
            self._count(implausible=1)
            return None
        if last is not None and navdata.sequence > last:
            lost = navdata.sequence - last - 1
            self._count(missing=lost)
            if lost:
                self._lost.append((now, lost))
        return self._taken(navdata, clock, now)

    def _follows(self, navdata: Navdata, last: int, now: float) -> bool:
        """Whether a packet is the next one, or the first of a new count."""
        silent = now - (self.heard if self.heard is not None else now)
        if navdata.sequence > last:
            if navdata.sequence - last <= BURST + MOST_PACKETS * silent:
                return True
            self._count(implausible=1)
            return False
        was_bootstrap = self.navdata is not None and self.navdata.bootstrap
        anew = navdata.bootstrap != was_bootstrap
        if anew or (navdata.com_watchdog and silent > SILENCE):
            self.restarts += 1
            self._clock, self._least_ahead = None, math.inf
            return True
        if navdata.sequence == last:
            self._count(duplicates=1)
        else:
            # One of those that were counted as missing when the later one came.
            self._count(reordered=1, missing=-1 if self._counts.missing else 0)
        return False

    def _unwrapped(self, clock: float | None) -> float | None:
        """The drone's clock without its turns."""
        if clock is None or self._clock is None:
            return clock
        ahead = (clock - self._clock) % CLOCK_TURN
        return self._clock + (ahead if ahead < 0.5 * CLOCK_TURN else ahead - CLOCK_TURN)

    def _passed(self, clock: float | None, now: float) -> float | None:
        """Time since the last state by the clock that ran on more; None if one ran backwards."""
        passed = 0.0 if self.newest is None else now - self.newest.time
        if clock is None or self._clock is None:
            return max(passed, 0.0)
        return None if clock < self._clock else max(passed, clock - self._clock)

    def _jumps(self, navdata: Navdata, passed: float) -> bool:
        if self.newest is None or not self.newest.flying:
            return False
        height = navdata.height
        if height is None:
            return True
        return jumps(self.newest.height, height, passed, self.max_jump)

    def _taken(self, navdata: Navdata, clock: float | None, now: float) -> VehicleState | None:
        while self._lost and self._lost[0][0] < now - RECENT:
            self._lost.popleft()
        missing = max((lost for _, lost in self._lost), default=0)
        state = _state_of(navdata, clock, now, missing)
        gap = 0.0 if self.newest is None else now - self.newest.time
        self._first = now if self._first is None else self._first
        self._count(states=1)
        self._counts = replace(self._counts, longest_gap=max(self._counts.longest_gap, gap))
        self.sent = None
        if clock is not None:
            self._least_ahead = min(self._least_ahead, now - clock)
            self.sent = clock + self._least_ahead
        self.navdata, self.heard, self._clock, self.newest = navdata, now, clock, state
        return state

    def _count(self, **more: int) -> None:
        known = {name: getattr(self._counts, name) + number for name, number in more.items()}
        self._counts = replace(self._counts, **known)


def phase_of(navdata: Navdata) -> int | None:
    """The control state, None where the packet does not say it."""
    return None if navdata.demo is None else navdata.demo.major


def on_ground(navdata: Navdata) -> bool:
    """Whether a drone is down, and not on its way up.

    One that has forgotten its client says no more than whether it flies.
    """
    in_air = (FLYING, HOVERING, TAKING_OFF, CLIMBING, LANDING)
    return not navdata.flying and phase_of(navdata) not in in_air


def unasked_end(navdata: Navdata, left_ground: bool) -> str | None:
    """Why a drone that is asked to fly comes down or stays down; None while it does not.

    Parameters
    ----------
    navdata : Navdata
    left_ground : bool
        Whether it was in the air since it was asked to take off.
    """
    if navdata.emergency:
        return "the vehicle reports an emergency"
    if navdata.communication_lost:
        return "the vehicle has heard no command for 2 s, and lands by itself"
    if phase_of(navdata) != LANDING and not (left_ground and on_ground(navdata)):
        return None
    fault = _fault_of(navdata)
    if fault is not None:
        return f"the vehicle lands by itself: {fault}"
    return (
        "the vehicle lands without having been told so from here, and reports no fault: most "
        "likely another client commands this drone"
    )


def _fault_of(navdata: Navdata) -> str | None:
    return next((says for bit, says in FAULTS.items() if navdata.state & bit), None)


def _state_of(navdata: Navdata, clock: float | None, now: float, missing: int) -> VehicleState:
    return VehicleState(
        time=now,
        height=navdata.height or 0.0,
        flying=navdata.flying and phase_of(navdata) in (FLYING, HOVERING),
        landed=on_ground(navdata),
        sequence=navdata.sequence,
        vehicle_time=clock,
        climb=navdata.climb,
        climb_setpoint=navdata.climb_setpoint,
        # NaN is no angle that a watch would let pass.
        roll=math.nan if navdata.roll is None else navdata.roll,
        pitch=math.nan if navdata.pitch is None else navdata.pitch,
        battery=navdata.battery,
        emergency=navdata.emergency,
        fault=_fault_of(navdata),
        missing=missing,
    )
