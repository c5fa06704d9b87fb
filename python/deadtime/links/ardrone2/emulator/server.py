"""The emulated drone on sockets: navdata and commands on UDP, the configuration on TCP.

It runs in whatever event loop it is opened in, of real or of virtual time.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from functools import partial
from types import TracebackType
from typing import Self

from deadtime._errors import LinkError
from deadtime.links.ardrone2.emulator.drone import Drone, Truth
from deadtime.links.ardrone2.emulator.link import Address
from deadtime.links.ardrone2.emulator.options import EmulatorOptions

__all__ = ["Emulator"]

#: Navdata that could not leave in time, because the machine was busy, are not sent later, s.
STALE = 0.25

#: Connections for the configuration at a time, and what one may leave unread, bytes.
MOST_CONNECTIONS = 4
MOST_UNREAD = 65536


class _Port(asyncio.DatagramProtocol):
    """Hands datagrams on; errors of replies that nobody wanted are no business of the drone."""

    def __init__(
        self, received: Callable[[bytes, Address], None], answers: Callable[[str], bool]
    ) -> None:
        self._received, self._answers = received, answers

    def datagram_received(self, data: bytes, addr: Address) -> None:
        if self._answers(addr[0]):
            self._received(data, (addr[0], addr[1]))


class _Control(asyncio.Protocol):
    """A connection that reads the configuration; what it says is not listened to."""

    def __init__(self, emulator: Emulator) -> None:
        self._emulator = emulator
        self.transport: asyncio.Transport | None = None
        self.host = ""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self.host = transport.get_extra_info("peername")[0]
        self._emulator._connected(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self._emulator._readers.discard(self)

    def write(self, dump: bytes) -> None:
        """Send a configuration, to whoever reads what is sent."""
        if self.transport is None:
            return
        if self.transport.get_write_buffer_size() > MOST_UNREAD:
            self.transport.abort()
        else:
            self.transport.write(dump)

    @property
    def reads(self) -> bool:
        """Whether the other end is still there."""
        return self.transport is not None and not self.transport.is_closing()


class Emulator:
    """An emulated AR.Drone 2.0 that listens on sockets of the running event loop.

    Use it as an asynchronous context manager. It answers to whoever can reach it, as the vehicle
    does: by default that is this machine only, and where it is more, the clients that are named.

    Parameters
    ----------
    options : EmulatorOptions, optional
        The ``kit`` plant on the vehicle's ports by default.

    Attributes
    ----------
    drone : Drone
        What is emulated; its `Drone.truth` is for tests and displays.
    host : str
    navdata_port, command_port, control_port : int
        Where it listens, once it is open.

    Raises
    ------
    LinkError
        On opening, if a port cannot be had.

    Examples
    --------
    >>> from deadtime import links
    >>> async def look():
    ...     options = EmulatorOptions(navdata_port=0, command_port=0, control_port=0)
    ...     async with Emulator(options) as emulator:
    ...         return emulator.truth().phase
    >>> links.run(look())
    <Phase.LANDED: 'landed'>
    """

    def __init__(self, options: EmulatorOptions | None = None) -> None:
        self.options = options or EmulatorOptions()
        self.drone = Drone(self.options)
        self.host = self.options.host
        self.navdata_port, self.command_port = self.options.navdata_port, self.options.command_port
        self.control_port = self.options.control_port
        self._readers: set[_Control] = set()
        self._unread: dict[str, tuple[float, bytes]] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._commands: asyncio.DatagramTransport | None = None
        self._navdata: asyncio.DatagramTransport | None = None
        self._control: asyncio.AbstractServer | None = None

    async def __aenter__(self) -> Self:
        try:
            await self._open()
        except OSError as error:
            await self.close()
            raise LinkError(
                f"the emulator cannot listen on {self.host}, ports {self.navdata_port}, "
                f"{self.command_port}, {self.control_port}: {error.strerror}; choose others, or 0 "
                "for free ones"
            ) from error
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        self.drone = Drone(self.options, start=loop.time())
        for name, received in (("navdata", self._woken), ("command", self._commanded)):
            transport, _ = await loop.create_datagram_endpoint(
                partial(_Port, received, self.options.answers),
                local_addr=(self.host, getattr(self, f"{name}_port")),
            )
            setattr(self, f"{name}_port", transport.get_extra_info("sockname")[1])
            if name == "navdata":
                self._navdata = transport
            else:
                self._commands = transport
        self._control = await loop.create_server(
            lambda: _Control(self), self.host, self.control_port
        )
        self.control_port = self._control.sockets[0].getsockname()[1]
        self._go_on()

    async def close(self) -> None:
        """Stop listening; safe to call twice."""
        if self._timer is not None:
            self._timer.cancel()
        for transport in (self._navdata, self._commands):
            if transport is not None:
                transport.close()
        if self._control is not None:
            self._control.close()
        for reader in list(self._readers):
            if reader.transport is not None:
                reader.transport.abort()
        self._timer = self._navdata = self._commands = self._control = None

    def truth(self) -> Truth:
        """What the drone does now, without noise."""
        return self.drone.truth(asyncio.get_running_loop().time())

    def _woken(self, datagram: bytes, source: Address) -> None:
        self.drone.woken(datagram, source, asyncio.get_running_loop().time())
        self._go_on()

    def _commanded(self, datagram: bytes, source: Address) -> None:
        self.drone.commanded(datagram, source, asyncio.get_running_loop().time())
        for host, dump in self.drone.dumps():
            self._tell(host, dump)
        self._go_on()

    def _go_on(self) -> None:
        """Let what is due happen and leave, and come back when the next thing is due."""
        loop = asyncio.get_running_loop()
        if self._navdata is None or self._navdata.is_closing():
            return
        now = loop.time()
        self.drone.advance(now)
        for packet, address in self.drone.packets(now, oldest=STALE):
            self._navdata.sendto(packet, address)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        due = self.drone.due()
        if due < math.inf:
            self._timer = loop.call_at(due, self._go_on)

    def _connected(self, reader: _Control) -> None:
        welcome = len(self._readers) < MOST_CONNECTIONS and self.options.answers(reader.host)
        if not welcome and reader.transport is not None:
            reader.transport.abort()
            return
        self._readers.add(reader)
        asked, dump = self._unread.pop(reader.host, (-math.inf, b""))
        if asyncio.get_running_loop().time() - asked <= 1.0:
            reader.write(dump)

    def _tell(self, host: str, dump: bytes) -> None:
        """Send a configuration to the connections of the host that asked for it.

        Some ask first and connect then.
        """
        readers = [one for one in self._readers if one.host == host and one.reads]
        for reader in readers:
            reader.write(dump)
        if not readers:
            self._unread = {host: (asyncio.get_running_loop().time(), dump)}
