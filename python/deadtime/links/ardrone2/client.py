"""The AR.Drone 2.0 as a vehicle whose climb can be commanded."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

from deadtime._base.errors import FlightAbortedError, LinkError
from deadtime._base.validation import finite
from deadtime.links.ardrone2.commands import FlatTrim
from deadtime.links.ardrone2.connection import LOST, Connection
from deadtime.links.ardrone2.limit_settings import LimitSettings
from deadtime.links.ardrone2.navdata import Navdata
from deadtime.links.ardrone2.reader import (
    FLYING,
    HOVERING,
    LinkStatistics,
    on_ground,
    phase_of,
)
from deadtime.links.ardrone2.sender import CommandSender
from deadtime.links.clock import now
from deadtime.links.safety import Limits, UnitCommand
from deadtime.links.vehicle import Motion, VehicleState
from deadtime.links.vehicle_link import CHECK_EVERY, VehicleLink

#: Longest wait for the first navdata, and for the end of bootstrap, s.
FIRST_NAVDATA = 5.0

#: Time for the drone to calibrate its level, s.
TRIM_TIME = 0.3

#: Navdata sent this long after a command show its effect, s.
ANSWERED = 1.0

#: Time for the drone to confirm a toggle of the emergency, s, and number of copies of the datagram:
#: copies have the same number, and the drone executes one.
TOGGLING, COPIES = 5.0, 3


class ARDrone2(VehicleLink):
    """A link to an AR.Drone 2.0, or to an emulator of one.

    As an asynchronous context manager it connects on entry, and lands and closes on exit, also by
    an exception. Connecting commands the drone to stay on the ground and never takes off.

    Parameters
    ----------
    host : str
        Address of the drone.
    limits : Limits, optional
        Limits of its flights. Largest climb and height are set in the drone too, as far as it
        accepts them, and restored when the link is closed.
    full : bool
        Full navdata, 200 times a second, with vertical speed and its setpoint; otherwise short
        ones, 15 times a second.
    navdata_port, command_port, control_port : int
        5554, 5556 and 5559 on a drone.

    Raises
    ------
    ValueError
        If a port is not from 1 to 65535.

    Examples
    --------
    >>> drone = ARDrone2("192.168.1.1")
    >>> drone.command(0.3)
    Traceback (most recent call last):
    deadtime._base.errors.LinkError: 192.168.1.1 is not in the air: take off before giving commands
    """

    longest_take_off, longest_landing, longest_silence = 15.0, 20.0, 3.0
    lands_unheard = "the vehicle lands by itself, 2 s after the last command it has received"

    def __init__(
        self,
        host: str,
        limits: Limits | None = None,
        *,
        full: bool = True,
        navdata_port: int = 5554,
        command_port: int = 5556,
        control_port: int = 5559,
    ) -> None:
        ports = {
            "navdata_port": navdata_port,
            "command_port": command_port,
            "control_port": control_port,
        }
        for name, port in ports.items():
            if not 1 <= port <= 65535:
                raise ValueError(f"{name}={port}: give a port from 1 to 65535")
        self.host = host
        self.limits = Limits() if limits is None else limits
        self.full = full
        self.control_port = control_port
        self._ports = navdata_port, command_port
        self._restarts = 0
        self._vz_max: float | None = None
        self._settings = LimitSettings(host)
        self._take_off_sent = -math.inf
        self._link = self._new_link()

    def _new_link(self) -> Connection:
        """A new connection: the state of an earlier one does not count."""
        link = Connection(self.host, *self._ports, self.limits)
        self._sender, self._reader = link.sender, link.reader
        return link

    @property
    def statistics(self) -> LinkStatistics:
        """Statistics of the navdata since the last connection."""
        return self._reader.statistics

    @property
    def axes(self) -> tuple[str, ...]:
        """The height: the horizontal commands are angles, not speeds."""
        return ("z",)

    @property
    def vz_max(self) -> float:
        """Vertical speed for a command of 1, read back from the drone, m/s.

        Raises
        ------
        LinkError
            If it is not connected.
        """
        if self._vz_max is None:
            raise LinkError(
                f"{self.host} is not connected, so the scale of its commands is not known: "
                "connect first"
            )
        return self._vz_max

    # What a link is made of

    @property
    def _name(self) -> str:
        return self.host

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
    def _commanded(self) -> CommandSender:
        return self._sender

    def _age(self) -> None:
        self._link.age()

    def _send(self) -> None:
        self._link.send()

    async def _until(self, condition: Callable[[], bool], timeout: float) -> bool:
        return await self._link.until(lambda navdata: condition(), timeout)

    async def _put_back(self) -> str | None:
        return await self._settings.put_back(self._link)

    def _shut(self) -> None:
        self._link.shut()
        self._vz_max = None

    # Connecting

    async def _open(self) -> None:
        if self._reader.heard is not None:
            listener, self._link = self._link.listener, self._new_link()
            self._link.listener = listener
        await self._link.open()

    async def _configure(self) -> None:
        link, host = self._link, self.host
        heard = await link.until(lambda navdata: True, FIRST_NAVDATA)
        if not heard:
            raise LinkError(
                f"no navdata has arrived from {host}, UDP port {link.navdata_port}, within "
                f"{FIRST_NAVDATA:g} s. Check that the drone is on, this computer is in its "
                "network, and no other client is connected"
            )
        await self._settings.set(link, self.control_port, self.limits, self.full)
        if not await link.until(lambda navdata: navdata.demo is not None, FIRST_NAVDATA):
            raise LinkError(
                f"the navdata of {host} contain neither height nor battery: restart the drone"
            )
        self._vz_max = self._settings.vz_max
        self._restarts = self._reader.restarts

    # Flying

    async def _prepare(self) -> None:
        speed = self.vz_max
        state = await self.state()
        if state.emergency:
            raise LinkError(
                f"{self.host} is in emergency: check the drone, then call clear_emergency()"
            )
        if not state.landed:
            raise LinkError(f"{self.host} is not on the ground: land the drone first")
        if state.battery is not None and state.battery < self.limits.min_battery:
            raise LinkError(
                f"the battery of {self.host} is at {state.battery:g} %, below the limit of "
                f"{self.limits.min_battery:g} %: charge the battery"
            )
        if self.limits.max_climb > speed:
            raise LinkError(
                f"max_climb = {self.limits.max_climb:g} m/s exceeds the drone's largest "
                f"vertical speed of {speed:g} m/s: give a smaller max_climb"
            )
        self._link.send(FlatTrim())
        asked = now()
        await asyncio.sleep(TRIM_TIME)
        late = now() - asked - TRIM_TIME
        if late > self.limits.command_age:
            raise LinkError(
                f"this program was paused for {late:.2f} s just before the take-off of "
                f"{self.host}, so the last known state is old: take off again"
            )

    async def _climb(self) -> None:
        self._take_off_sent = now()
        self._sender.fly()
        await self._wait_up(lambda: _is_up(self._reader.navdata))
        navdata = self._reader.navdata
        if navdata is None or navdata.emergency:
            raise FlightAbortedError(f"{self.host} changed to emergency during the take-off")
        self._sender.guard(now())

    async def _first_state(self) -> None:
        if not await self._until(lambda: self._newest is not None, FIRST_NAVDATA):
            raise LinkError(f"no state has arrived from {self.host} within {FIRST_NAVDATA:g} s")

    def _check_vehicle(self) -> None:
        if self._sender.rival is not None:
            raise LinkError(self._sender.rival)
        if self._link.silent > LOST:
            raise LinkError(self._link.unheard)
        if self._vz_max is not None and self._reader.restarts > self._restarts:
            raise LinkError(self._link.forgotten)

    def command(self, climb: float) -> float:
        """Command a vertical speed; it is sent at once and repeated until it is too old.

        Parameters
        ----------
        climb : float
            m/s, up positive. Clipped to ``limits.max_climb``.

        Returns
        -------
        float
            The speed that was sent, m/s: 0 while it is unknown whether the drone still flies after
            a pause of this program.

        Raises
        ------
        ValueError
            If `climb` is not finite.
        LinkError
            If the drone has not taken off, or if the flight has ended without `land`: without
            commands, by a pause of this program, by a landing, or by another client.
        """
        requested = finite("climb", climb)
        self._check_in_air()
        most = min(self.limits.max_climb, self.vz_max)
        share = UnitCommand.saturated(max(-most, min(most, requested)) / self.vz_max)
        sent = self._sender.climb(share, now())
        self._link.send()
        return float(sent) * self.vz_max

    def command_velocity(
        self, north: float = 0.0, east: float = 0.0, up: float = 0.0, turn: float | None = None
    ) -> Motion:
        """Command a vertical speed, as `command` does: the drone has no other axis.

        Raises
        ------
        ValueError
            If a number but `up` is not zero.
        LinkError
            As `command`.
        """
        if north or east or turn:
            raise ValueError(
                "an AR.Drone 2.0 takes speed commands only for the climb, because its "
                "horizontal commands are angles"
            )
        return Motion(up=self.command(up))

    def listen(self, listener: Callable[[VehicleState], None] | None) -> None:
        """Register `listener` for every state; None removes it.

        If it raises, it is removed, and the next `state` raises `LinkError` from that error.
        """
        self._link.listener = listener

    # Landing

    def _stop(self) -> bool:
        self._sender.land()
        if not self._link.is_open or self._reader.newest is None:
            return False
        self._link.send()
        return True

    def _keep_landing(self, passed: float) -> None:
        """The sender repeats the landing command by itself."""

    def _landed(self) -> None:
        """The sender commands to be on the ground until the next take-off."""

    def _is_down(self) -> bool:
        """Whether a drone is down, by navdata new enough to show the beginning of a take-off."""
        navdata, sent = self._reader.navdata, self._link.newest_sent
        if navdata is None or sent is None:
            return False
        return on_ground(navdata) and sent >= self._take_off_sent + ANSWERED

    async def cut_motors(self) -> None:
        """Stop the motors at once, at any height: the drone falls.

        For a drone that is about to hurt somebody; landing never does this. The command is sent
        once, and again only if navdata sent 1 s later still show its motors on.

        Raises
        ------
        LinkError
            If the drone does not confirm this within 5 s.
        """
        self._sender.land()
        if not await self._toggled(lambda navdata: navdata.emergency):
            raise LinkError(f"{self.host} does not confirm that its motors have stopped")

    async def clear_emergency(self) -> None:
        """Reset the emergency of a drone on the ground.

        Raises
        ------
        LinkError
            If it stays in emergency.
        """
        self._sender.land()
        if not await self._toggled(lambda navdata: not navdata.emergency):
            raise LinkError(
                f"{self.host} stays in emergency: check the motors, and check that the drone "
                "stands level"
            )

    async def _toggled(self, requested: Callable[[Navdata], bool]) -> bool:
        """Toggle between emergency and normal until the drone reports the requested state.

        The drone has one signal for both directions, so a second one too early would undo the
        first. It is repeated only after navdata that were sent long after the first and still show
        the old state.
        """
        link = self._link
        deadline = now() + TOGGLING
        while not await link.until(requested, 0.0):
            self._sender.cut = True
            link.send(copies=COPIES)
            toggled = now()
            while not await link.until(requested, CHECK_EVERY):
                if now() > deadline:
                    return False
                # Packets that waited in the socket during a pause of this program are old too.
                since = max(toggled, self._sender.resumed)
                if link.newest_sent is not None and link.newest_sent >= since + ANSWERED:
                    break
        return True


def _is_up(navdata: Navdata | None) -> bool:
    if navdata is None:
        return False
    return navdata.emergency or (navdata.flying and phase_of(navdata) in (FLYING, HOVERING))
