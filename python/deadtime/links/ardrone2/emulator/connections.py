"""TCP connections to an emulated drone: few at a time, and none in the way of the next.

Who connects is taken in, in place of the youngest connection if all places are taken: those that
a client keeps from its start on stay, and a crowd of idle ones leaves a place for the next. A
connection whose host gives no sign of life is closed after a while.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from deadtime.links.addresses import canonical

__all__ = ["Connection", "Door"]

#: Connections to a port at a time, and what one may leave unread, bytes.
MOST_CONNECTIONS = 4
MOST_UNREAD = 65536

#: A connection whose host gives no sign of life for so long is closed, s.
IDLE = 30.0


class Connection(asyncio.Protocol):
    """A connection that is written to; what it says is not listened to."""

    def __init__(self, door: Door) -> None:
        self._door = door
        self._transport: asyncio.Transport | None = None
        self.host = ""
        #: When its host gave its last sign of life.
        self.heard = 0.0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self.host = canonical(transport.get_extra_info("peername")[0])
        self._door.enter(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by asyncio."""
        self._door.leave(self)

    def write(self, data: bytes) -> None:
        """Send something, to whoever reads what is sent."""
        if self._transport is None:
            return
        if self._transport.get_write_buffer_size() > MOST_UNREAD:
            self.abort()
        else:
            self._transport.write(data)

    def end(self) -> None:
        """Close it when all that was written is sent."""
        if self._transport is not None:
            self._transport.close()

    def abort(self) -> None:
        """Close it at once."""
        if self._transport is not None:
            self._transport.abort()

    @property
    def is_open(self) -> bool:
        """Whether the other end is still there."""
        return self._transport is not None and not self._transport.is_closing()


class Door:
    """What a TCP port makes connections by.

    Parameters
    ----------
    answers : callable
        Whether a host is let in.
    welcome : callable
        Called with each connection that is.
    """

    def __init__(
        self, answers: Callable[[str], bool], welcome: Callable[[Connection], None]
    ) -> None:
        self._answers, self._welcome = answers, welcome
        self._inside: dict[Connection, asyncio.TimerHandle] = {}

    def __call__(self) -> Connection:
        """A protocol for asyncio."""
        return Connection(self)

    def enter(self, connection: Connection) -> None:
        """Take a new connection in, if its host is welcome."""
        if not self._answers(connection.host):
            connection.abort()
            return
        if len(self._inside) >= MOST_CONNECTIONS:
            youngest = next(reversed(self._inside))
            self.leave(youngest)
            youngest.abort()
        loop = asyncio.get_running_loop()
        connection.heard = loop.time()
        self._inside[connection] = loop.call_later(IDLE, self._look, connection)
        self._welcome(connection)

    def leave(self, connection: Connection) -> None:
        """Forget a connection."""
        timer = self._inside.pop(connection, None)
        if timer is not None:
            timer.cancel()

    def _look(self, connection: Connection) -> None:
        """Close a connection that has been idle for too long, or look again."""
        loop = asyncio.get_running_loop()
        end = connection.heard + IDLE
        if loop.time() >= end:
            self.leave(connection)
            connection.abort()
        else:
            self._inside[connection] = loop.call_at(end, self._look, connection)  # in its old place

    def hear(self, host: str) -> None:
        """A host has given a sign of life."""
        for connection in self.of(host):
            connection.heard = asyncio.get_running_loop().time()

    def of(self, host: str) -> list[Connection]:
        """The open connections of a host."""
        return [one for one in self._inside if one.host == host and one.is_open]

    def close(self) -> None:
        """Close all connections."""
        for connection in list(self._inside):
            self.leave(connection)
            connection.abort()
