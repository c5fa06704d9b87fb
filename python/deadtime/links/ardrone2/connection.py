"""The two sockets to a drone, and the task that sends to it continuously."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.ardrone2.commands import Command
from deadtime.links.ardrone2.navdata import Navdata
from deadtime.links.ardrone2.reader import NavdataReader
from deadtime.links.ardrone2.sender import CYCLE, CommandSender
from deadtime.links.clock import now
from deadtime.links.safety import Limits
from deadtime.links.vehicle import VehicleState

#: Silence after which the link counts as lost, s.
LOST = 1.0

#: The packet that requests navdata.
WAKE_UP = b"\x01\x00\x00\x00"

#: Time between two requests while nothing is received, s.
WAKE_AGAIN = 0.2

#: Copies of the landing command when the link closes, in case some are lost.
FINAL_COPIES = 3


class Connection:
    """Packets to and from one drone; its reader and its sender interpret them.

    Parameters
    ----------
    host : str
        Address of the drone.
    navdata_port, command_port : int
        Its UDP ports.
    limits : Limits
        Limits of the age of commands and of the change of the height.

    Attributes
    ----------
    reader : NavdataReader
        Reads what is received.
    sender : CommandSender
        Makes what is sent.
    listener : callable or None
        Called with every state.
    failure : Exception or None
        The error of the listener, which is then removed.
    """

    def __init__(self, host: str, navdata_port: int, command_port: int, limits: Limits) -> None:
        self.host = host
        self.navdata_port, self.command_port = navdata_port, command_port
        self.reader = NavdataReader(limits.max_jump)
        self.sender = CommandSender(limits)
        self.listener: Callable[[VehicleState], None] | None = None
        self.failure: Exception | None = None
        self._arrived = asyncio.Event()
        self._navdata: asyncio.DatagramTransport | None = None
        self._commands: asyncio.DatagramTransport | None = None
        self._cycle: asyncio.Task[None] | None = None
        self._woken = 0.0

    @property
    def is_open(self) -> bool:
        """Whether the link is open."""
        return self._cycle is not None

    @property
    def forgotten(self) -> str:
        """Message for a drone whose numbers have restarted."""
        return (
            f"{self.host} has restarted its count of packets, so it does not listen to this "
            "client any more: land, and connect again"
        )

    @property
    def unheard(self) -> str:
        """Message for a drone that sends nothing."""
        return (
            f"nothing has been received from {self.host} for {self.silent:.1f} s. Either the "
            "drone is off or out of reach, or it sends its navdata to another client"
        )

    @property
    def newest_sent(self) -> float | None:
        """When the newest navdata were sent, s; when they arrived, if the drone sends no clock."""
        return self.reader.heard if self.reader.sent is None else self.reader.sent

    @property
    def silent(self) -> float:
        """Time since the last packet, s."""
        heard = self.reader.heard
        return 0.0 if heard is None else now() - heard

    async def open(self) -> None:
        """Open the sockets and begin to send: the command to be on the ground, until changed.

        Raises
        ------
        LinkError
            If the host cannot be reached, or the connection is open.
        """
        if self.is_open:
            raise LinkError(f"{self.host} is connected already")
        try:
            # Connected sockets receive packets of the drone only.
            self._navdata = await self._socket(self.navdata_port, self.take)
            self._commands = await self._socket(self.command_port, lambda packet: None)
        except OSError as error:
            self.shut()
            raise LinkError(f"{self.host} cannot be reached: {error}") from None
        except BaseException:
            self.shut()
            raise
        self._cycle = asyncio.get_running_loop().create_task(self._keep_sending())

    async def _socket(self, port: int, take: Callable[[bytes], None]) -> asyncio.DatagramTransport:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _PeerFilter(take, self.reader.refuse), remote_addr=(self.host, port)
        )
        return transport

    def shut(self) -> None:
        """Command the drone to land, and close the sockets."""
        if self._cycle is not None:
            self._cycle.cancel()
            # A task that is cancelled before it starts would not send the landing command.
            self._send_landing()
        for transport in (self._navdata, self._commands):
            if transport is not None:
                transport.close()
        self._cycle = self._navdata = self._commands = None

    async def _keep_sending(self) -> None:
        """Send a datagram each cycle, and the request for navdata while nothing is received."""
        try:
            while self._navdata is not None:
                quiet = self.reader.heard is None or self.silent > WAKE_AGAIN
                if quiet and now() - self._woken >= WAKE_AGAIN:
                    self._woken = now()
                    self._navdata.sendto(WAKE_UP)
                self.send()
                await asyncio.sleep(CYCLE)
        finally:
            # Also executed when the program ends without closing the link.
            self._send_landing()

    def _send_landing(self) -> None:
        self.sender.land()
        for _ in range(FINAL_COPIES):
            self.send()

    def send(self, *more: Command, copies: int = 1) -> None:
        """Send the next datagram now in so many copies; `more` is added to this one only."""
        if self._commands is None or self._commands.is_closing():
            return
        self.age()
        navdata = self.reader.navdata
        alive = navdata is None or navdata.com_watchdog or self.silent > WAKE_AGAIN
        datagram = self.sender.datagram(now(), alive, more)
        for _ in range(copies):
            self._commands.sendto(datagram)

    def age(self) -> None:
        """Let commands expire that are too old."""
        self.sender.age(now())
        if self.silent > LOST:  # it may have landed: commands may not reach it either
            self.sender.give_up(self.unheard)

    def take(self, packet: bytes) -> None:
        """Process a packet of the drone."""
        reader = self.reader
        before, restarts = reader.navdata, reader.restarts
        state = reader.accept(packet, now())
        if reader.restarts > restarts:
            self.sender.give_up(self.forgotten)
        if reader.navdata is not None and reader.navdata is not before:
            self.sender.received(reader.navdata, reader.sent)
        self._arrived.set()
        if state is None or self.listener is None:
            return
        try:
            self.listener(state)
        except Exception as error:
            # Nobody could catch the error here: the next `state` raises it.
            self.listener, self.failure = None, error

    async def until(self, holds: Callable[[Navdata], bool], timeout: float) -> bool:
        """Wait until the condition holds of the navdata; False after the timeout, s."""
        deadline = now() + timeout
        while True:
            navdata = self.reader.navdata
            if navdata is not None and holds(navdata):
                return True
            left = deadline - now()
            if left <= 0.0:
                return False
            self._arrived.clear()
            try:
                # Before Python 3.12 `wait_for` loses a cancellation that comes with a packet.
                async with asyncio.timeout(left):
                    await self._arrived.wait()
            except TimeoutError:
                return False


class _PeerFilter(asyncio.DatagramProtocol):
    """Passes on datagrams from the address and port that the socket is connected to."""

    def __init__(self, take: Callable[[bytes], None], refuse: Callable[[], None]) -> None:
        self._take, self._refuse = take, refuse
        self._peer: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._peer = transport.get_extra_info("peername")

    def datagram_received(self, data: bytes, addr: Any) -> None:
        if self._peer is not None and tuple(addr[:2]) != tuple(self._peer[:2]):
            self._refuse()
        else:
            self._take(data)

    def error_received(self, exc: Exception) -> None:
        """A refused datagram counts as lost; the following silence is detected."""
