"""A vehicle over MAVLink whose speeds can be commanded."""

from __future__ import annotations

import asyncio
import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from deadtime._base.errors import LinkError
from deadtime._base.validation import positive
from deadtime.links.axes import AXES
from deadtime.links.clock import now
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.authority import Authority
from deadtime.links.mavlink.autopilots import Autopilot, autopilot_of
from deadtime.links.mavlink.changed_parameters import ChangedParameters, VehicleId
from deadtime.links.mavlink.codec import dialect
from deadtime.links.mavlink.connection import Connection
from deadtime.links.mavlink.parameters import Parameters
from deadtime.links.mavlink.senders import is_autopilot
from deadtime.links.mavlink.set_points import CYCLE, SetPoints
from deadtime.links.mavlink.settings import Settings
from deadtime.links.mavlink.states import ON_GROUND, UNKNOWN, StateReader, echo_of
from deadtime.links.mavlink.take_off import SHOWN, TakeOff, ask_over_all
from deadtime.links.mavlink.time_sync import LinkTime
from deadtime.links.safety import Limits
from deadtime.links.vehicle import Echo, VehicleState

#: Longest wait for the first heartbeat, s.
FIRST_HEARTBEAT = 10.0

#: Time in which every vehicle on the link has sent a heartbeat, s.
HEARTBEATS = 1.5

#: Time between two landing commands, and between landing and the command to disarm, s.
AGAIN, DISARM_AFTER = 0.5, 3.0


class MAVLinkVehicle(Settings):
    """A link to a multicopter with ArduPilot or PX4.

    As an asynchronous context manager it connects on entry, and lands and closes on exit, also by
    an exception. Connecting never arms. A vehicle that is armed already is not taken over; one that
    somebody else disarms is not armed again; one that somebody else takes over is left to them.

    Parameters
    ----------
    address : str
        ``udp:HOST:PORT`` to wait there for the vehicle, ``udpout:HOST:PORT`` to send first,
        ``tcp:HOST:PORT`` to connect to it, ``serial:DEVICE:BAUD`` for a serial port. With commas
        between them several links to the same vehicle: the first is used, the others stand by for
        when it falls silent.
    limits : Limits, optional
        Limits of its flights. Height and tilt are set in the vehicle too, and put back when the
        link is closed.
    take_off_height : float
        Height of a take-off, m.
    system, component : int
        Ids of this end. ArduPilot watches the heartbeats of the system SYSID_MYGCS only.
    vehicle : int, optional
        System id of the vehicle; needed where several are on the link.
    key : bytes, optional
        Signing key, 32 bytes: unsigned frames are refused then.
    simulated : bool
        Refuse a vehicle that does not say that it is a simulator, before anything is set in it.
    folder : Path, optional
        Where the old values of parameters are kept in a file while they are changed; the working
        directory if not given. What an earlier run has left is looked for there, and beside a
        folder that was given.

    Raises
    ------
    MissingExtraError
        If pymavlink is not installed.
    ValueError
        If an address, an id, or a height is not possible.

    Examples
    --------
    >>> vehicle = MAVLinkVehicle("tcp:127.0.0.1:5760")
    >>> vehicle.command(0.3)
    Traceback (most recent call last):
    deadtime._base.errors.LinkError: tcp:127.0.0.1:5760 is not in the air: take off before \
giving commands
    """

    longest_take_off, longest_landing, longest_silence = 30.0, 60.0, 5.0
    lands_unheard = "the vehicle lands by its own failsafe"

    def __init__(
        self,
        address: str,
        limits: Limits | None = None,
        *,
        take_off_height: float = 1.0,
        system: int = 255,
        component: int = 190,
        vehicle: int | None = None,
        key: bytes | None = None,
        simulated: bool = False,
        folder: Path | None = None,
    ) -> None:
        self.addresses = LinkAddress.all_of(address)
        self.address = ",".join(map(str, self.addresses))
        self.limits = Limits() if limits is None else limits
        self.take_off_height = positive("take_off_height", take_off_height)
        if not self.limits.min_height < take_off_height < self.limits.max_height:
            raise ValueError(
                f"take_off_height={take_off_height:g} m is not within the limits, "
                f"{self.limits.min_height:g} to {self.limits.max_height:g} m"
            )
        for name, number in {"system": system, "component": component, "vehicle": vehicle}.items():
            if number is not None and not 1 <= number <= 255:
                raise ValueError(f"{name}={number}: give a number from 1 to 255")
        self._ids = system, component
        self._vehicle, self._key, self._simulated = vehicle, key, simulated
        self._folder = folder
        self._listener: Callable[[VehicleState], None] | None = None
        self._echo_listener: Callable[[Echo], None] | None = None
        self._parameters: Parameters | None = None
        self._autopilot: Autopilot | None = None
        self._cycle: asyncio.Task[None] | None = None
        self._new_link()

    def _new_link(self) -> None:
        """A new connection: the state of an earlier one does not count."""
        self._link = Connection(self.addresses, *self._ids, self._vehicle, self._key)
        self._reader = StateReader()
        self._link.take, self._link.switched = self._take, self._reader.count_anew
        self._set_points = SetPoints(self.limits)
        self._allowed = set()
        self._authority = Authority(self.address)
        self._landing_sent = -math.inf
        self._failing: str | None = None
        self._meddled: str | None = None
        self._asking: dict[str, asyncio.Task[None]] = {}

    @property
    def axes(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(AXES)

    @property
    def link_time(self) -> LinkTime | None:
        """Round trip and clock offset of the link in use, by TIMESYNC; None before an answer."""
        return self._link.link_time

    @property
    def foreign(self) -> list[str]:
        """Who else sends on this link, in words; their messages are ignored."""
        return [f"{other} ({other.frames} frames)" for other in self._link.senders.foreign.values()]

    @property
    def autopilot(self) -> str:
        """Name of the firmware.

        Raises
        ------
        LinkError
            If it is not connected.
        """
        return self._known.name

    # What a link is made of

    @property
    def _name(self) -> str:
        return self.address

    @property
    def _is_open(self) -> bool:
        return self._link.is_open

    @property
    def _newest(self) -> VehicleState | None:
        return self._reader.newest

    @property
    def _listener_failure(self) -> Exception | None:
        return self._link.failure

    @property
    def _silence(self) -> float:
        return self._link.silent

    @property
    def _commanded(self) -> SetPoints:
        return self._set_points

    async def _until(self, condition: Callable[[], bool], timeout: float) -> bool:
        return await self._link.until(condition, timeout)

    def _said(self, since: float) -> str:
        return self._link.said(since)

    @property
    def _remark(self) -> str | None:
        return self._failing

    # Connecting

    async def _open(self) -> None:
        self._new_link()
        await self._link.open()

    async def _configure(self) -> None:
        pilot = await self._meet()
        await self._recover(lambda what: warnings.warn(what, RuntimeWarning, stacklevel=5))
        await pilot.set_limits(self._held, self.limits, self._ids[0])
        await self._held.apply()
        self._cycle = asyncio.get_running_loop().create_task(self._keep_sending())

    async def _meet(self) -> Autopilot:
        """Wait for the vehicle, and refuse one that must not be flown; nothing is set in it."""
        link = self._link
        heartbeat = await link.next(is_autopilot, FIRST_HEARTBEAT)
        await link.until(lambda: self._reader.armed is not None, FIRST_HEARTBEAT)
        if heartbeat is None:
            heard = f"; others send: {', '.join(self.foreign)}" if self.foreign else ""
            raise LinkError(
                f"within {FIRST_HEARTBEAT:g} s no heartbeat of a vehicle has arrived at "
                f"{self.address}{heard}"
            )
        pilot = self._autopilot = autopilot_of(heartbeat)
        self._reader.estimator = pilot.estimator
        if self._vehicle is None or len(self.addresses) > 1:
            await asyncio.sleep(HEARTBEATS)
        if self._vehicle is None and (others := link.senders.vehicles):
            raise LinkError(
                f"{self.address} reaches several vehicles, system {link.target[0]}, "
                f"{', '.join(map(str, others))}: give `vehicle`, the system number of the "
                "vehicle to fly"
            )
        if strangers := link.carriers.other_vehicles:
            raise LinkError(
                f"the vehicles at {strangers[0].address} and {link.carriers.current.address} "
                "have different clocks, so they are two vehicles: give only links to one "
                "vehicle"
            )
        self._authority.refuse_armed(self._reader)
        vehicle = VehicleId(pilot.name, link.target[0], await link.board())
        changed = ChangedParameters.new(vehicle, self._folder or Path())
        self._parameters = Parameters(link, pilot.integers_as_bits, changed)
        if self._simulated and not await self._is_simulator(pilot):
            raise LinkError(
                f"the vehicle at {self.address} does not report that it is a simulator, and a "
                "router may lead to a real vehicle. If its flight cannot hurt or damage "
                "anything, give simulated=False, or --i-have-a-safe-area on the command line"
            )
        await ask_over_all(link, pilot)
        await link.until(lambda: self._reader.landed_state != UNKNOWN, SHOWN)
        return pilot

    async def restore(self) -> list[str]:
        """Put back what earlier runs have left changed in the vehicle, which is not flown.

        Returns
        -------
        list of str
            What was done, in sentences; empty where nothing was left.

        Raises
        ------
        LinkError
            If it is connected, the vehicle does not answer, is not on the ground, or does not keep
            a value.
        """
        if self._is_open:
            raise LinkError(f"{self.address} is connected already")
        await self._open()
        try:
            await self._meet()
            said: list[str] = []
            await self._recover(said.append)
            return said
        finally:
            self._shut()

    async def _is_simulator(self, pilot: Autopilot) -> bool:
        name = pilot.simulated
        return name is not None and await self._held.read(name) is not None

    def listen(self, listener: Callable[[VehicleState], None] | None) -> None:
        """Register `listener` for every state; None removes it.

        If it raises, it is removed, and the next `state` raises `LinkError` from that error.
        """
        self._listener = listener

    def listen_to_echoes(self, listener: Callable[[Echo], None] | None) -> None:
        """Register `listener` for every echo of a set point, as `listen` for states."""
        self._echo_listener = listener

    def _take(self, message: Any, time: float) -> None:
        state = self._reader.take(message, time)
        if self._autopilot is not None:
            self._compare(message, time, self._autopilot)
        try:
            if state is not None and self._listener is not None:
                self._listener(state)
            if message.get_type() == "POSITION_TARGET_LOCAL_NED" and self._echo_listener:
                self._echo_listener(echo_of(message, time))
        except Exception:
            self._listener = self._echo_listener = None
            raise

    # Flying

    async def _prepare(self) -> None:
        if self._meddled is not None:
            raise LinkError(f"{self.address}: {self._meddled}. Connect again")
        self._set_points.expired = None  # that of an earlier flight
        await self._steps().prepare(self.limits.min_battery)

    async def _climb(self) -> None:
        await self._steps().fly(self.take_off_height, self._set_points, self._wait_up)
        self._origin = await self.state()

    def _steps(self) -> TakeOff:
        return TakeOff(self._link, self._known, self._reader, self._authority, self._check_link)

    async def _first_state(self) -> None:
        if not await self._until(lambda: self._newest is not None, FIRST_HEARTBEAT):
            raise LinkError(
                f"{self.address}: {self._known.name} sends no LOCAL_POSITION_NED, so the "
                "vehicle has no position yet"
            )

    async def _keep_sending(self) -> None:
        """Repeat set points, and land a vehicle that was given up."""
        try:
            while True:
                self._age()
                if self._set_points.due(now()):
                    self._send()
                if self._set_points.expired is not None:
                    self._command_landing()
                await asyncio.sleep(CYCLE)
        finally:
            # Also when the program ends without closing the link.
            self._command_landing()

    # Landing

    def _command_landing(self) -> None:
        """Command a vehicle that this link has armed to land, unless somebody took it over."""
        time = now()
        if not self._authority.holds or self._autopilot is None or not self._reader.armed:
            return
        if time - self._landing_sent < AGAIN or self._reader.mode == self._autopilot.landing:
            return
        self._landing_sent = time
        self._authority.land(self._autopilot.landing)
        d = dialect()
        values = [*self._autopilot.mode(self._autopilot.landing), *[0.0] * 5][:7]
        self._link.send(
            d.MAVLink_command_long_message(*self._link.target, d.MAV_CMD_DO_SET_MODE, 0, *values)
        )

    def _stop(self) -> bool:
        """Send no set points any more; a vehicle that somebody else flies is not commanded."""
        self._set_points.stop()
        self._command_landing()
        self._disarming_sent = -math.inf
        return self._link.is_open and self._autopilot is not None and self._authority.armed_here

    def _keep_landing(self, passed: float) -> None:
        self._command_landing()
        lands = self._reader.mode == self._known.landing or self._reader.landed_state == ON_GROUND
        if self._authority.is_sure and not lands:
            raise LinkError(f"{self._authority.lost}. The vehicle was not commanded to land")
        on_ground = self._reader.landed_state == ON_GROUND and self._authority.holds
        if on_ground and passed > DISARM_AFTER and now() - self._disarming_sent > AGAIN:
            self._disarming_sent, d = now(), dialect()
            self._link.send(
                d.MAVLink_command_long_message(
                    *self._link.target, d.MAV_CMD_COMPONENT_ARM_DISARM, 0, *[0.0] * 7
                )
            )

    def _landed(self) -> None:
        self._authority.ended()

    def _is_down(self) -> bool:
        """Whether it is down for sure, by news from when it must have been armed."""
        heard = min(self._reader.arming.heard, self._reader.landing.heard)
        return self._reader.is_down and heard > self._authority.armed_at + SHOWN

    def _shut(self) -> None:
        if self._cycle is not None:
            self._cycle.cancel()
            self._command_landing()
        self._cycle = None
        for task in self._asking.values():
            task.cancel()
        self._link.shut()
        self._autopilot = self._parameters = None
