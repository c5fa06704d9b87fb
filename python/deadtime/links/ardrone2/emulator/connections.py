"""TCP connections to an emulated drone: their number is limited, and a new one is always accepted.

If the largest number is reached, a new connection replaces the most recent one. So connections that
a client keeps open from its start are kept, and many idle ones do not exclude further clients. A
connection whose host is inactive for a time is closed.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from deadtime.links.addresses import canonical

#: Most connections to a port at a time, and most unread bytes of one.
MOST_CONNECTIONS = 4
MOST_UNREAD = 65536

#: Inactivity of a host after which its connection is closed, s.
IDLE = 30.0


class Connection(asyncio.Protocol):
    """A connection for writing; received data are ignored."""

    def __init__(self, port: PortConnections) -> None:
        self._port = port
        self._transport: asyncio.Transport | None = None
        self.host = ""
        #: Time of the last activity of its host.
        self.active_at = 0.0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self.host = canonical(transport.get_extra_info("peername")[0])
        self._port.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by asyncio."""
        self._port.remove(self)

    def write(self, data: bytes) -> None:
        """Send data; close the connection if the client does not read them."""
        if self._transport is None:
            return
        if self._transport.get_write_buffer_size() > MOST_UNREAD:
            self.abort()
        else:
            self._transport.write(data)

    def end(self) -> None:
        """Close it after all data are sent."""
        if self._transport is not None:
            self._transport.close()

    def abort(self) -> None:
        """Close it at once."""
        if self._transport is not None:
            self._transport.abort()

    @property
    def is_open(self) -> bool:
        """Whether the connection is open."""
        return self._transport is not None and not self._transport.is_closing()


class PortConnections:
    """The accepted connections of a TCP port.

    Parameters
    ----------
    accepts : callable
        Whether a host is accepted.
    connected : callable
        Called with each accepted connection.
    """

    def __init__(
        self, accepts: Callable[[str], bool], connected: Callable[[Connection], None]
    ) -> None:
        self._accepts, self._connected = accepts, connected
        self._open: dict[Connection, asyncio.TimerHandle] = {}

    def __call__(self) -> Connection:
        """A protocol for asyncio."""
        return Connection(self)

    def add(self, connection: Connection) -> None:
        """Accept a new connection, if its host is allowed."""
        if not self._accepts(connection.host):
            connection.abort()
            return
        if len(self._open) >= MOST_CONNECTIONS:
            latest = next(reversed(self._open))
            self.remove(latest)
            latest.abort()
        loop = asyncio.get_running_loop()
        connection.active_at = loop.time()
        self._open[connection] = loop.call_later(IDLE, self._check_activity, connection)
        self._connected(connection)

    def remove(self, connection: Connection) -> None:
        """Remove a connection."""
        timer = self._open.pop(connection, None)
        if timer is not None:
            timer.cancel()

    def _check_activity(self, connection: Connection) -> None:
        """Close a connection whose host is inactive, or check again later."""
        loop = asyncio.get_running_loop()
        end = connection.active_at + IDLE
        if loop.time() >= end:
            self.remove(connection)
            connection.abort()
        else:
            # The connection keeps its position in the order of age.
            self._open[connection] = loop.call_at(end, self._check_activity, connection)

    def note_activity(self, host: str) -> None:
        """Note activity of a host."""
        for connection in self.of(host):
            connection.active_at = asyncio.get_running_loop().time()

    def of(self, host: str) -> list[Connection]:
        """The open connections of a host."""
        return [peer for peer in self._open if peer.host == host and peer.is_open]

    def close(self) -> None:
        """Close all connections."""
        for connection in list(self._open):
            self.remove(connection)
            connection.abort()
