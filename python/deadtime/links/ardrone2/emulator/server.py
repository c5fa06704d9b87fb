"""The emulated drone on sockets: navdata and commands on UDP, the configuration on TCP.

Two more ports accept connections. The one for files reports that there are none, and closes the
connection. The one for video sends nothing and stays open, because some clients fail at the end of
a stream.

It runs in the event loop in which it is opened, in real or virtual time.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from functools import partial
from typing import Self

from deadtime._base.errors import LinkError
from deadtime.links.addresses import Address, canonical, for_socket
from deadtime.links.ardrone2.emulator.connections import Connection, PortConnections
from deadtime.links.ardrone2.emulator.drone import Drone, Truth
from deadtime.links.ardrone2.emulator.options import EmulatorOptions

#: Age beyond which navdata that could not be sent in time are dropped, s.
STALE = 0.25

#: Time for which a configuration requested before the connection is kept, s.
KEPT_FOR = 1.0

#: Answer of the port for files (RFC 959: service not available, closing control connection).
NO_FILES = b"421 This is an emulator: it has no files.\r\n"


class _Port(asyncio.DatagramProtocol):
    """Passes datagrams of accepted hosts on; errors of undelivered replies are ignored."""

    def __init__(
        self, received: Callable[[bytes, Address], None], answers: Callable[[str], bool]
    ) -> None:
        self._received, self._answers = received, answers

    def datagram_received(self, data: bytes, addr: Address) -> None:
        if self._answers(addr[0]):
            self._received(data, (canonical(addr[0]), addr[1]))


class Emulator:
    """An emulated AR.Drone 2.0 that listens on sockets of the running event loop.

    Use it as an asynchronous context manager. It answers every host that can reach it, as the
    vehicle does: by default this machine only, otherwise the named clients.

    Parameters
    ----------
    options : EmulatorOptions, optional
        The ``kit`` plant on the vehicle's ports by default.

    Attributes
    ----------
    drone : Drone
        The emulated drone; its `Drone.truth` is for tests and displays.
    host : str
    navdata_port, command_port, control_port : int
        Address and ports on which it listens, once it is open.
    ftp_port, video_port : int or None
        Ports for file and video connections, if there are any.

    Raises
    ------
    LinkError
        On opening, if a port is not available.

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
        self.ftp_port, self.video_port = self.options.ftp_port, self.options.video_port
        answers = self.options.answers
        self._connections = {
            "control_port": PortConnections(answers, self._connected),
            "ftp_port": PortConnections(answers, _refuse_files),
            "video_port": PortConnections(answers, lambda connection: None),
        }
        self._opening = "navdata_port"
        self._unread: dict[str, tuple[float, bytes]] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._commands: asyncio.DatagramTransport | None = None
        self._navdata: asyncio.DatagramTransport | None = None
        self._servers: list[asyncio.AbstractServer] = []

    async def __aenter__(self) -> Self:
        try:
            await self._open()
        except OSError as error:
            await self.close()
            raise LinkError(
                f"the emulator cannot listen on {self.host}, {self._opening} "
                f"{getattr(self, self._opening)}: {error.strerror}. Give another port, or 0 for "
                "any free port. Ports below 1024 need administrator rights"
            ) from error
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        self.drone = Drone(self.options, start=loop.time())
        self._navdata = await self._listen("navdata_port", self._woken)
        self._commands = await self._listen("command_port", self._commanded)
        for name, port in self._connections.items():
            self._opening = name
            if getattr(self, name) is None:
                continue
            server = await loop.create_server(port, self.host, getattr(self, name))
            self._servers.append(server)
            setattr(self, name, server.sockets[0].getsockname()[1])
        self._process_events()

    async def _listen(
        self, name: str, received: Callable[[bytes, Address], None]
    ) -> asyncio.DatagramTransport:
        self._opening = name
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            partial(_Port, received, self.options.answers),
            local_addr=(self.host, getattr(self, name)),
        )
        setattr(self, name, transport.get_extra_info("sockname")[1])
        return transport

    async def close(self) -> None:
        """Stop listening; may be called again."""
        if self._timer is not None:
            self._timer.cancel()
        for transport in (self._navdata, self._commands):
            if transport is not None:
                transport.close()
        for server in self._servers:
            server.close()
        self._servers.clear()
        for port in self._connections.values():
            port.close()
        self._timer = self._navdata = self._commands = None

    def truth(self) -> Truth:
        """The true state of the drone now, without noise."""
        return self.drone.truth(asyncio.get_running_loop().time())

    def _woken(self, datagram: bytes, source: Address) -> None:
        self.drone.woken(datagram, source, asyncio.get_running_loop().time())
        self._process_events()

    def _commanded(self, datagram: bytes, source: Address) -> None:
        self.drone.commanded(datagram, source, asyncio.get_running_loop().time())
        for port in self._connections.values():
            port.note_activity(source[0])
        for host, dump in self.drone.dumps():
            self._send_configuration(host, dump)
        self._process_events()

    def _process_events(self) -> None:
        """Process and send what is due, and schedule the next event."""
        loop = asyncio.get_running_loop()
        if self._navdata is None or self._navdata.is_closing():
            return
        now, local = loop.time(), self._navdata.get_extra_info("sockname")[0]
        self.drone.advance(now)
        for packet, address in self.drone.packets(now, oldest=STALE):
            self._navdata.sendto(packet, for_socket(address, local))
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        due = self.drone.due()
        if due < math.inf:
            self._timer = loop.call_at(due, self._process_events)

    def _connected(self, reader: Connection) -> None:
        requested_at, dump = self._unread.pop(reader.host, (-math.inf, b""))
        if asyncio.get_running_loop().time() - requested_at <= KEPT_FOR:
            reader.write(dump)

    def _send_configuration(self, host: str, dump: bytes) -> None:
        """Send a configuration to the connections of the host that requested it.

        Some clients connect only after their request: their configuration is kept for a time.
        """
        readers = self._connections["control_port"].of(host)
        for reader in readers:
            reader.write(dump)
        if not readers:
            self._unread = {host: (asyncio.get_running_loop().time(), dump)}


def _refuse_files(connection: Connection) -> None:
    connection.write(NO_FILES)
    connection.end()
