"""Turn navdata packets into states of the vehicle, after checks of their plausibility.

A packet is accepted if its checksum is right, its sequence number is above the last one by no more
than the elapsed time allows, the clock of the drone does not go back and its height does not jump.
Its numbers restart only when the drone reports bootstrap, or the loss of its client after a
silence: its configuration may then be another one, which is reported to the owner of the link.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

from deadtime._base.errors import PacketError
from deadtime.links.ardrone2.navdata import Navdata, State, parse_navdata
from deadtime.links.safety import jumps
from deadtime.links.vehicle import VehicleState

#: The drone's clock counts its seconds in 11 bits.
CLOCK_TURN = 2048.0

#: Largest plausible number of packets a second, with bursts: the drone sends 200.
MOST_PACKETS, BURST = 1000.0, 100

#: Silence after which numbers may restart following a communication watchdog, s.
SILENCE = 0.5

#: Time for which a state reports lost messages, s.
RECENT = 1.0

#: Control states, the upper half of the word that navdata has for them.
FLYING, HOVERING = 3, 4
TAKING_OFF, CLIMBING, LANDING = 6, 7, 8


#: Bits of the drone's state that end a flight, in the words of `VehicleState.fault`.
FAULTS = {
    State.ULTRASOUND_DEAF: "its ultrasound receives no echo",
    State.MOTORS_PROBLEM: "a motor does not turn as it should",
    State.CUTOUT: "its motors have been stopped",
    State.ANGLES_OUT_OF_RANGE: "it is tilted too much",
    State.SOFTWARE_FAULT: "its program has failed",
    State.TOO_MUCH_WIND: "the wind is too strong",
    State.BATTERY_LOW: "its battery is sufficient only for landing",
}


@dataclass(frozen=True)
class LinkStatistics:
    """Statistics of the packets from a drone.

    Attributes
    ----------
    packets : int
        All packets from the address of the drone.
    states : int
        Accepted packets with a state.
    missing : int
        Sequence numbers that never arrived.
    duplicates, reordered : int
        Repeated packets, and packets that arrived after a later one; neither is used.
    broken : int
        Not navdata, truncated, or with a wrong checksum.
    implausible : int
        With an impossible sequence number, clock or height.
    foreign : int
        From another address or port.
    restarts : int
        How often the numbers of the drone restarted.
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
        Largest plausible rate of change of the height, m/s.

    Attributes
    ----------
    newest : VehicleState or None
        The newest state.
    navdata : Navdata or None
        Its packet; also one of bootstrap, which has no state.
    heard : float or None
        Arrival of the last accepted packet, s.
    sent : float or None
        Time at which that packet was sent, s: by the clock of the drone, synchronised by the
        fastest packet. It is too late by the delay of that packet, which cannot be measured from
        one end. None where the packet does not hold the clock.
    restarts : int
        How often the numbers of the drone restarted.
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
        """The statistics until now."""
        rate = 0.0
        if self._first is not None and self.newest is not None and self.newest.time > self._first:
            rate = (self._counts.states - 1) / (self.newest.time - self._first)
        return replace(self._counts, restarts=self.restarts, rate=rate)

    def refuse(self) -> None:
        """Count a packet from another address."""
        self._count(foreign=1)

    def accept(self, packet: bytes, now: float) -> VehicleState | None:
        """Process a packet.

        Parameters
        ----------
        packet : bytes
            The received bytes.
        now : float
            Arrival, s.

        Returns
        -------
        VehicleState or None
            Its state, which is then `newest`; None if it has none or is not accepted.
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
        """Whether a packet follows the last one, or is the first of a new count."""
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
            # It was counted as missing when a later one arrived.
            self._count(reordered=1, missing=-1 if self._counts.missing else 0)
        return False

    def _unwrapped(self, clock: float | None) -> float | None:
        """The clock of the drone without its wraps."""
        if clock is None or self._clock is None:
            return clock
        ahead = (clock - self._clock) % CLOCK_TURN
        return self._clock + (ahead if ahead < 0.5 * CLOCK_TURN else ahead - CLOCK_TURN)

    def _passed(self, clock: float | None, now: float) -> float | None:
        """Time since the last state, the larger of both clocks; None if one went back."""
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
    """The control state, None where the packet does not hold it."""
    return None if navdata.demo is None else navdata.demo.major


def on_ground(navdata: Navdata) -> bool:
    """Whether a drone is on the ground, and not taking off.

    A drone that has dropped its client reports only whether it flies.
    """
    in_air = (FLYING, HOVERING, TAKING_OFF, CLIMBING, LANDING)
    return not navdata.flying and phase_of(navdata) not in in_air


def unasked_end(navdata: Navdata, left_ground: bool) -> str | None:
    """Why a drone that is commanded to fly lands or does not take off; None while it flies.

    Parameters
    ----------
    navdata : Navdata
    left_ground : bool
        Whether it has been in the air since the take-off command.
    """
    if navdata.emergency:
        return "the vehicle reports an emergency"
    if navdata.communication_lost:
        return "the vehicle has received no command for 2 s, and lands by itself"
    if phase_of(navdata) != LANDING and not (left_ground and on_ground(navdata)):
        return None
    fault = _fault_of(navdata)
    if fault is not None:
        return f"the vehicle lands by itself: {fault}"
    return (
        "the vehicle lands without a command from this program, and reports no fault. Most "
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
        # A NaN makes the watch end the flight.
        roll=math.nan if navdata.roll is None else navdata.roll,
        pitch=math.nan if navdata.pitch is None else navdata.pitch,
        battery=navdata.battery,
        emergency=navdata.emergency,
        fault=_fault_of(navdata),
        missing=missing,
    )
