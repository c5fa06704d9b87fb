"""A vehicle over MAVLink whose speeds can be commanded."""

from __future__ import annotations

import asyncio
import math
import warnings
from collections.abc import Callable
from typing import Any, Self

from deadtime._base.errors import LinkError
from deadtime._base.validation import positive
from deadtime.links.axes import AXES
from deadtime.links.clock import now
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.authority import Authority
from deadtime.links.mavlink.autopilots import Autopilot, autopilot_of
from deadtime.links.mavlink.codec import dialect
from deadtime.links.mavlink.commanding import Commanding
from deadtime.links.mavlink.connection import Connection
from deadtime.links.mavlink.parameters import Parameters
from deadtime.links.mavlink.senders import is_autopilot
from deadtime.links.mavlink.set_points import CYCLE, SetPoints
from deadtime.links.mavlink.states import ON_GROUND, StateReader, echo_of
from deadtime.links.mavlink.take_off import SHOWN, TakeOff, ask_over_all
from deadtime.links.mavlink.time_sync import LinkTime
from deadtime.links.safety import Limits
from deadtime.links.uninterrupted import note, uninterrupted
from deadtime.links.vehicle import Echo, VehicleState

#: Longest wait for the first heartbeat, s.
FIRST_HEARTBEAT = 10.0

#: Time in which every vehicle on the link has sent a heartbeat, s.
HEARTBEATS = 1.5

#: Longest duration of a landing, s.
LONGEST_LANDING = 60.0

#: Silence after which the link counts as lost while landing, s.
LOST_LANDING = 5.0

#: Time between two landing commands, and between landing and the command to disarm, s.
AGAIN, DISARM_AFTER = 0.5, 3.0


class MAVLinkVehicle(Commanding):
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
commanding it
    """

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
    ) -> None:
        self.addresses = LinkAddress.all_of(address)
        self.address = ",".join(map(str, self.addresses))
        self.limits = Limits() if limits is None else limits
        self.take_off_height = positive("take_off_height", take_off_height)
        if not self.limits.min_height < take_off_height < self.limits.max_height:
            raise ValueError(
                f"take_off_height={take_off_height:g} is outside {self.limits.min_height:g} to "
                f"{self.limits.max_height:g} m"
            )
        for name, number in {"system": system, "component": component, "vehicle": vehicle}.items():
            if number is not None and not 1 <= number <= 255:
                raise ValueError(f"{name}={number}: give a number from 1 to 255")
        self._ids = system, component
        self._vehicle, self._key, self._simulated = vehicle, key, simulated
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
        return [f"{one} ({one.frames} frames)" for one in self._link.senders.foreign.values()]

    @property
    def autopilot(self) -> str:
        """Name of the firmware.

        Raises
        ------
        LinkError
            If it is not connected.
        """
        return self._known.name

    # Connecting

    async def connect(self) -> None:
        """Wait for the vehicle, set its limits, and ask for its messages.

        Raises
        ------
        LinkError
            If it does not answer, is armed already, is no simulator where `simulated` asks for
            one, or does not keep a setting; if another one answers over another link.
        """
        if self._link.is_open:
            raise LinkError(f"{self.address} is connected already")
        self._new_link()
        await self._link.open()
        try:
            await self._configure()
        except BaseException as error:
            if self._parameters is not None:
                note(error, await self._parameters.put_back())
            self._shut()
            raise

    async def _configure(self) -> None:
        link = self._link
        heartbeat = await link.next(is_autopilot, FIRST_HEARTBEAT)
        if heartbeat is None:
            heard = f"; others send: {', '.join(self.foreign)}" if self.foreign else ""
            raise LinkError(
                f"no vehicle sends heartbeats at {self.address} within {FIRST_HEARTBEAT:g} s{heard}"
            )
        pilot = self._autopilot = autopilot_of(heartbeat)
        self._reader.estimator = pilot.estimator
        if self._vehicle is None or len(self.addresses) > 1:
            await asyncio.sleep(HEARTBEATS)
        if self._vehicle is None and (others := link.senders.vehicles):
            raise LinkError(
                f"several vehicles are on {self.address}: system {link.target[0]}, "
                f"{', '.join(map(str, others))}: give `vehicle`, the system of the one to fly"
            )
        if strangers := link.carriers.other_vehicles:
            raise LinkError(
                f"another vehicle answers over {strangers[0].address} than over "
                f"{link.carriers.current.address}: its clock is another one; give links to one "
                "vehicle"
            )
        self._authority.refuse_armed(self._reader)
        self._parameters = Parameters(link, pilot.integers_as_bits)
        if self._simulated and not await self._is_simulator(pilot):
            raise LinkError(
                f"what answers at {self.address} does not say that it is a simulator: a router "
                "there may lead to a vehicle. If nobody and nothing can be hurt by its flight, "
                "take simulated=False, or --i-have-a-safe-area on the command line"
            )
        await pilot.set_limits(self._parameters, self.limits, self._ids[0])
        await ask_over_all(link, pilot)
        self._cycle = asyncio.get_running_loop().create_task(self._keep_sending())

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
        if message.get_type() == "HEARTBEAT" and self._autopilot is not None:
            self._authority.heard(self._reader, self._autopilot, self._link, time)
            if self._authority.lost is not None:
                self._set_points.give_up(self._authority.lost)
        try:
            if state is not None and self._listener is not None:
                self._listener(state)
            if message.get_type() == "POSITION_TARGET_LOCAL_NED" and self._echo_listener:
                self._echo_listener(echo_of(message, time))
        except Exception:
            self._listener = self._echo_listener = None
            raise

    async def parameter(self, name: str) -> float:
        """The value of a parameter of the vehicle.

        Raises
        ------
        LinkError
            If it is not connected, or does not answer.
        """
        value = await self._held.read(name)
        if value is None:
            raise LinkError(f"{self.address}: the vehicle does not answer for its {name}")
        return value

    async def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, and read it back; the old value is put back when the link is closed.

        Raises
        ------
        LinkError
            If it is not connected, or does not keep the value.
        """
        await self._held.set(name, value)

    async def shaping(self, axis: str) -> tuple[float, float | None] | None:
        """Within which limits the vehicle lets a commanded rate change, by its parameters.

        Parameters
        ----------
        axis : str
            One of `axes`.

        Returns
        -------
        (float, float or None) or None
            Largest rate of change, 1/s² times the unit of the axis, and largest rate of that,
            where it has one; None where the vehicle does not tell.

        Raises
        ------
        LinkError
            If it is not connected.
        """
        found: list[float | None] = []
        for parameter in self._known.shaping.get(axis, ()):
            value = None if parameter is None else await self._held.read(parameter.name)
            found.append(None if not value or parameter is None else parameter.factor * value)
        if not found or found[0] is None:
            return None
        return found[0], found[1]

    # Flying

    async def take_off(self) -> None:
        """Arm and take off; returns when the vehicle holds its height and accepts set points.

        Waits for its position estimate, which takes up to a minute after power-up.

        Raises
        ------
        LinkError
            If it is not connected, not on the ground, armed or disarmed by somebody else, low on
            battery, does not arm, or is not up in time; it is then commanded to land.
        """
        self._set_points.expired = None  # that of an earlier flight
        steps = TakeOff(self._link, self._known, self._reader, self._authority, self._check_link)
        await steps.prepare(self.limits.min_battery)
        try:
            await steps.fly(self.take_off_height, self._set_points)
            self._origin = await self.state()
        except BaseException:
            self._set_points.stop()
            self._command_landing()
            raise

    async def state(self) -> VehicleState:
        """The newest state; waits for the first.

        Raises
        ------
        LinkError
            If the vehicle sends nothing, or the flight has ended without `land`, as of `command`.
        """
        pilot, reader = self._known, self._reader
        if not await self._link.until(lambda: reader.newest is not None, FIRST_HEARTBEAT):
            raise LinkError(
                f"{self.address}: {pilot.name} sends no LOCAL_POSITION_NED: it has no position yet"
            )
        self._check_link()
        assert reader.newest is not None
        return reader.newest

    async def _keep_sending(self) -> None:
        """Repeat set points, and land a vehicle that was given up."""
        try:
            while True:
                self._age()
                if self._set_points.due(now()):
                    self._send_set_point()
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

    async def land(self) -> None:
        """Land; returns when the vehicle is on the ground and disarmed.

        A vehicle that somebody else has taken over is not commanded: it is waited for if it lands.

        Raises
        ------
        LinkError
            If it does not report this in time, sends nothing, or is flown by somebody else.
        """
        self._set_points.stop()
        if not self._link.is_open or self._autopilot is None or not self._authority.armed_here:
            return
        begin, disarmed, link, d = now(), 0.0, self._link, dialect()
        while not await link.until(self._is_down, 0.1):
            self._command_landing()
            time = now()
            if link.silent > LOST_LANDING:
                raise LinkError(f"{self._unheard} while landing: it lands by its own failsafe")
            if not self._authority.holds and self._reader.mode != self._autopilot.landing:
                raise LinkError(f"{self._authority.lost}: it was not commanded to land")
            if time - begin > LONGEST_LANDING:
                raise LinkError(f"{self.address} has not landed within {LONGEST_LANDING:g} s")
            on_ground = self._reader.landed_state == ON_GROUND and self._authority.holds
            if on_ground and time - begin > DISARM_AFTER and time - disarmed > AGAIN:
                disarmed = time
                link.send(
                    d.MAVLink_command_long_message(
                        *link.target, d.MAV_CMD_COMPONENT_ARM_DISARM, 0, *[0.0] * 7
                    )
                )
        self._authority.ended()

    def _is_down(self) -> bool:
        """Whether it is down, by a state that is new enough to show that it was armed."""
        state = self._reader.newest
        return state is not None and state.landed and state.time > self._authority.armed_at + SHOWN

    async def close(self) -> None:
        """Land if in the air, put the parameters back, and close the link.

        Raises
        ------
        LinkError
            As `land` does; the link is closed nevertheless.

        Warns
        -----
        RuntimeWarning
            If it has landed and a parameter could not be put back.
        """
        try:
            await uninterrupted(self._end())
        finally:
            self._shut()
            self._autopilot = self._parameters = None

    async def _end(self) -> None:
        kept = None
        try:
            await self.land()
        except LinkError as error:
            # The failsafes remain in a vehicle that this link has left in the air.
            if not self._authority.holds and self._parameters is not None:
                note(error, await self._parameters.put_back())
            raise
        if self._parameters is not None:
            kept = await self._parameters.put_back()
        if kept is not None:
            warnings.warn(kept, RuntimeWarning, stacklevel=2)

    def _shut(self) -> None:
        if self._cycle is not None:
            self._cycle.cancel()
            self._command_landing()
        self._cycle = None
        self._link.shut()

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            await self.close()
        except LinkError as problem:
            if error is None:
                raise
            note(error, str(problem), *getattr(problem, "__notes__", ()))
