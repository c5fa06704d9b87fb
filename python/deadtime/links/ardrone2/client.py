"""The AR.Drone 2.0 as a vehicle whose climb can be commanded."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from deadtime._errors import FlightAbortedError, LinkError
from deadtime._validation import finite
from deadtime.links.ardrone2.commands import Command, FlatTrim
from deadtime.links.ardrone2.handshake import Handshake, check_configuration
from deadtime.links.ardrone2.navdata import Navdata
from deadtime.links.ardrone2.reader import (
    FLYING,
    HOVERING,
    LinkStatistics,
    NavdataReader,
    on_ground,
    phase_of,
)
from deadtime.links.ardrone2.sender import CYCLE, CommandSender
from deadtime.links.safety import Limits, UnitCommand
from deadtime.links.vehicle import VehicleState

__all__ = ["ARDrone2"]

#: What wakes the drone's navdata.
WAKE_UP = b"\x01\x00\x00\x00"

#: How often the wake-up is sent again while nothing comes, s.
WAKE_AGAIN = 0.2

#: How long the first navdata, and leaving bootstrap, may take, s.
FIRST_NEWS = 5.0

#: How long nothing may come until the link counts as lost, s.
LOST = 1.0

#: How long taking off may take until the drone holds its height, and landing, s.
TAKING_OFF, LANDING = 15.0, 20.0

#: How long the drone is given to measure what level is, s.
TRIMMING = 0.3

#: How long nothing may come while landing, s: by then the drone's own watchdog lands it.
SILENT_LANDING = 3.0

#: Largest vertical speed that a command of 1 stands for, mm/s: what the drone may be told is
#: 200 to 2000, its own default 700.
VZ_MAX = 1000

#: Longest heights of the drone's own limit, mm.
ALTITUDE_MAX = (500, 5000)

#: Last words to a drone when the link closes, in case some are lost.
LAST_WORDS = 3


class ARDrone2:
    """A link to an AR.Drone 2.0, or to an emulator of one.

    As an asynchronous context manager it connects on entry, and lands and closes on the way out,
    whatever the reason. Connecting tells the drone to be on the ground and never takes off.

    Parameters
    ----------
    host : str
        Address of the drone.
    limits : Limits, optional
        What it is kept within. The largest height is set in the drone, too.
    full : bool
        All of navdata, 200 times a second, with vertical speed and the demand that is followed;
        otherwise the 15 small ones.
    navdata_port, command_port, control_port : int
        5554, 5556 and 5559 on a drone.

    Examples
    --------
    >>> drone = ARDrone2("192.168.1.1")
    >>> drone.command(0.3)
    Traceback (most recent call last):
    deadtime._errors.LinkError: 192.168.1.1 is not in the air: take off before commanding it
    """

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
        self.host = host
        self.limits = Limits() if limits is None else limits
        self.full = full
        self._ports = (navdata_port, command_port, control_port)
        self._reader = NavdataReader(self.limits.max_jump)
        self._sender = CommandSender(self.limits)
        self._arrived = asyncio.Event()
        self._listener: Callable[[VehicleState], None] | None = None
        self._failure: Exception | None = None
        self._sockets: list[asyncio.DatagramTransport] = []
        self._cycle: asyncio.Task[None] | None = None
        self._restarts = 0
        self._vz_max: float | None = None
        self._woken = 0.0

    @property
    def statistics(self) -> LinkStatistics:
        """What came over the link until now."""
        return self._reader.statistics

    @property
    def vz_max(self) -> float:
        """Vertical speed that a command of 1 stands for, as read back from the drone, m/s.

        Raises
        ------
        LinkError
            If it is not connected.
        """
        if self._vz_max is None:
            raise LinkError(f"{self.host} is not connected: what a command means is not known")
        return self._vz_max

    # Connecting

    async def connect(self) -> None:
        """Wake the drone up, set its limits and read them back.

        Raises
        ------
        LinkError
            If it does not answer, or does not hold what it was told.
        """
        if self._cycle is not None:
            raise LinkError(f"{self.host} is connected already")
        loop = asyncio.get_running_loop()
        navdata_port, command_port, control_port = self._ports
        try:
            for port in (navdata_port, command_port):
                # Connected to the drone: the system hands on what comes from there alone.
                transport, _ = await loop.create_datagram_endpoint(
                    lambda port=port: _Door(self, port == navdata_port),  # type: ignore[misc]
                    remote_addr=(self.host, port),
                )
                self._sockets.append(transport)
        except OSError as error:
            self._shut()
            raise LinkError(f"{self.host} cannot be reached: {error}") from None
        self._cycle = loop.create_task(self._keep_sending())
        try:
            await self._configure(control_port)
        except BaseException:
            self._shut()
            raise

    async def _configure(self, control_port: int) -> None:
        heard = await self._until(lambda navdata: True, FIRST_NEWS)
        if not heard:
            raise LinkError(
                f"no navdata from {self.host}, UDP port {self._ports[0]}, within {FIRST_NEWS:g} s: "
                "is the drone on, and this computer in its network?"
            )
        handshake = Handshake(self.host, self._say, self._until)
        highest = round(1e3 * self.limits.max_height)
        wanted = {
            "general:navdata_demo": "FALSE" if self.full else "TRUE",
            "control:control_vz_max": str(VZ_MAX),
            "control:altitude_max": str(min(max(highest, ALTITUDE_MAX[0]), ALTITUDE_MAX[1])),
        }
        for key, value in wanted.items():
            await handshake.set(key, value)
        held = await handshake.read_back(self.host, control_port)
        check_configuration(self.host, held, wanted)
        if not await self._until(lambda navdata: navdata.demo is not None, FIRST_NEWS):
            raise LinkError(f"{self.host} sends navdata without height and battery: restart it")
        self._vz_max = 1e-3 * float(held["control:control_vz_max"])
        self._restarts = self._reader.restarts

    # Flying

    async def take_off(self) -> None:
        """Leave the ground; returns when the drone holds its height.

        Raises
        ------
        LinkError
            If it is not connected, not on the ground, in an emergency, low on battery, or does not
            come up in 15 s; it is then told to land.
        """
        speed = self.vz_max
        state = await self.state()
        if state.emergency:
            raise LinkError(f"{self.host} is in emergency: look at it, then clear_emergency()")
        if not state.landed:
            raise LinkError(f"{self.host} is not on the ground: land it first")
        if state.battery is not None and state.battery < self.limits.min_battery:
            raise LinkError(
                f"the battery of {self.host} is at {state.battery:g} %, below "
                f"{self.limits.min_battery:g} %: charge it"
            )
        if self.limits.max_climb > speed:
            raise LinkError(
                f"max_climb = {self.limits.max_climb:g} m/s is more than the drone's largest "
                f"vertical speed of {speed:g} m/s: ask for less"
            )
        self._say(FlatTrim())
        await asyncio.sleep(TRIMMING)
        self._sender.fly()
        try:
            up = await self._until(_is_up, TAKING_OFF)
        except BaseException:
            self._sender.land()
            raise
        newest = self._reader.newest
        if not up or newest is None or newest.emergency:
            self._sender.land()
            if newest is not None and newest.emergency:
                raise FlightAbortedError(f"{self.host} went into emergency while taking off")
            raise LinkError(f"{self.host} is not up {TAKING_OFF:g} s after the take-off")
        self._sender.guard(self._now())

    async def state(self) -> VehicleState:
        """The newest state; waits for the first.

        Raises
        ------
        LinkError
            If the drone fell silent, began to count anew, or was landed because no command came.
        """
        if self._cycle is None:
            raise LinkError(f"{self.host} is not connected")
        if self._reader.newest is None and not await self._until(_tells_state, FIRST_NEWS):
            raise LinkError(f"no state of {self.host} within {FIRST_NEWS:g} s")
        self._check_link()
        state = self._reader.newest
        assert state is not None
        return state

    def _check_link(self) -> None:
        if self._failure is not None:
            raise LinkError(
                f"what listens to {self.host} has failed: {self._failure}"
            ) from self._failure
        if self._sender.expired is not None:
            raise FlightAbortedError(self._sender.expired)
        silent = self._silent()
        if silent > LOST:
            raise LinkError(f"nothing heard of {self.host} for {silent:.1f} s")
        if self._vz_max is not None and self._reader.restarts > self._restarts:
            raise LinkError(
                f"{self.host} began to count anew, so it has forgotten this client: land, and "
                "connect again"
            )

    def command(self, climb: float) -> float:
        """Ask for a vertical speed; it is sent at once and repeated while it is young.

        Parameters
        ----------
        climb : float
            m/s, up positive. Clipped to ``limits.max_climb``.

        Returns
        -------
        float
            What was sent, m/s.

        Raises
        ------
        ValueError
            If `climb` is not finite.
        LinkError
            If the drone was not told to take off, or was landed because no command came.
        """
        wanted = finite("climb", climb)
        if self._sender.expired is not None:
            raise FlightAbortedError(self._sender.expired)
        if not self._sender.guarded:
            raise LinkError(f"{self.host} is not in the air: take off before commanding it")
        most = min(self.limits.max_climb, self.vz_max)
        share = UnitCommand.saturated(max(-most, min(most, wanted)) / self.vz_max)
        self._sender.climb(share, self._now())
        self._send()
        return float(share) * self.vz_max

    def hover(self) -> None:
        """Ask for no motion; like a command it is good for a short while, then the drone lands."""
        self._sender.hover(self._now())
        self._send()

    def listen(self, listener: Callable[[VehicleState], None] | None) -> None:
        """Call `listener` with every state from now on; None: no longer.

        If it raises, it is not called again, and the next `state` raises `LinkError` from that.
        """
        self._listener = listener

    # Coming down

    async def land(self) -> None:
        """Land; returns when the drone is on the ground.

        Raises
        ------
        LinkError
            If it does not say so in 20 s, or says nothing for 3 s: by then its own watchdog lands
            it. It is told to land as long as the link is open.
        """
        self._sender.land()
        if self._cycle is None or self._reader.newest is None:
            return
        self._send()
        deadline = self._now() + LANDING
        while not await self._until(_has_landed, 0.1):
            silent = self._silent()
            if silent > SILENT_LANDING:
                raise LinkError(
                    f"nothing heard of {self.host} for {silent:.1f} s while landing: its own "
                    "watchdog lands it 2 s after the last command it heard"
                )
            if self._now() > deadline:
                raise LinkError(f"{self.host} has not landed in {LANDING:g} s")

    async def close(self) -> None:
        """Land if in the air, and end the link; may be called twice.

        Raises
        ------
        LinkError
            As `land` does; the link is closed all the same.
        """
        try:
            await _uninterrupted(self.land())
        finally:
            self._shut()

    async def cut_motors(self) -> None:
        """Stop the motors at once, whatever the height: the drone falls.

        For a drone that is about to hurt somebody. Landing never does this.

        Raises
        ------
        LinkError
            If the drone does not say within 2 s that it did.
        """
        self._sender.land()
        if not await self._toggled(lambda navdata: navdata.emergency):
            raise LinkError(f"{self.host} does not confirm that its motors are cut")

    async def clear_emergency(self) -> None:
        """Bring a drone on the ground from emergency back to normal.

        Raises
        ------
        LinkError
            If it stays in emergency.
        """
        self._sender.land()
        if not await self._toggled(lambda navdata: not navdata.emergency):
            raise LinkError(f"{self.host} stays in emergency: check its motors and its level")

    async def _toggled(self, wanted: Callable[[Navdata], bool]) -> bool:
        """Toggle between emergency and normal, which takes a rising edge, until it is so."""
        for _ in range(10):
            if await self._until(wanted, 0.0):
                return True
            self._sender.cut = True
            self._send()
            if await self._until(wanted, 0.2):
                return True
        return False

    # The link

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    def _silent(self) -> float:
        """How long nothing was heard, s."""
        heard = self._reader.heard
        return 0.0 if heard is None else self._now() - heard

    async def _keep_sending(self) -> None:
        """A datagram each cycle, the wake-up while nothing comes."""
        try:
            while True:
                now = self._now()
                quiet = self._reader.heard is None or self._silent() > WAKE_AGAIN
                if quiet and now - self._woken >= WAKE_AGAIN:
                    self._woken = now
                    self._sockets[0].sendto(WAKE_UP)
                self._send()
                await asyncio.sleep(CYCLE)
        finally:
            # Reached also when the program ends without having closed the link.
            self._sender.land()
            for _ in range(LAST_WORDS):
                self._send()

    def _send(self, *more: Command) -> None:
        if len(self._sockets) < 2 or self._sockets[1].is_closing():
            return
        navdata = self._reader.navdata
        alive = navdata is None or navdata.com_watchdog or self._silent() > WAKE_AGAIN
        self._sockets[1].sendto(self._sender.datagram(self._now(), alive, more))

    def _say(self, command: Command) -> None:
        self._send(command)

    def _take(self, packet: bytes) -> None:
        state = self._reader.accept(packet, self._now())
        self._arrived.set()
        if state is None or self._listener is None:
            return
        try:
            self._listener(state)
        except Exception as error:
            # Here nobody could catch it; whoever flies is told with the next state.
            self._listener, self._failure = None, error

    async def _until(self, holds: Callable[[Navdata], bool], timeout: float) -> bool:
        """Wait until navdata are so; False if they are not before the timeout."""
        deadline = self._now() + timeout
        while True:
            navdata = self._reader.navdata
            if navdata is not None and holds(navdata):
                return True
            left = deadline - self._now()
            if left <= 0.0:
                return False
            self._arrived.clear()
            try:
                await asyncio.wait_for(self._arrived.wait(), left)
            except TimeoutError:
                return False

    def _shut(self) -> None:
        if self._cycle is not None:
            self._cycle.cancel()
            # Cancelled before it began, it would not say its last words; say them here and now.
            self._sender.land()
            for _ in range(LAST_WORDS):
                self._send()
        for transport in self._sockets:
            transport.close()
        self._cycle, self._vz_max = None, None
        self._sockets.clear()

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            await self.close()
        except LinkError as problem:
            if error is None:
                raise
            error.add_note(str(problem))


class _Door(asyncio.DatagramProtocol):
    """One of the two sockets; on that of navdata packets come in."""

    def __init__(self, drone: ARDrone2, navdata: bool) -> None:
        self._drone, self._navdata = drone, navdata
        self._peer: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._peer = transport.get_extra_info("peername")

    def datagram_received(self, data: bytes, addr: Any) -> None:
        if not self._navdata:
            return
        if self._peer is not None and tuple(addr[:2]) != tuple(self._peer[:2]):
            self._drone._reader.refuse()
        else:
            self._drone._take(data)

    def error_received(self, exc: Exception) -> None:
        """A refused datagram is like a lost one: the silence that follows says it."""


def _is_up(navdata: Navdata) -> bool:
    return navdata.emergency or (navdata.flying and phase_of(navdata) in (FLYING, HOVERING))


def _has_landed(navdata: Navdata) -> bool:
    return navdata.demo is not None and on_ground(navdata)


def _tells_state(navdata: Navdata) -> bool:
    return navdata.demo is not None


async def _uninterrupted(landing: Any) -> None:
    """See a landing to its end, which comes in bounded time, and only then be cancelled."""
    task = asyncio.ensure_future(landing)
    interrupted = False
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError:
            if task.cancelled():
                raise
            interrupted = True
        except LinkError:
            break
    if interrupted:
        raise asyncio.CancelledError
    task.result()
