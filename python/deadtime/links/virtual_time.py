"""An event loop in virtual time, with a network in memory.

An asyncio program that reads the time from its loop runs unchanged: its clock advances to the next
event at once, events are ordered by their times, and all runs give the same bits. Datagrams and
streams between addresses of the same loop arrive at once and in order; a relay adds delay, loss and
reordering. Threads, processes and real sockets are not supported, because the clock does not wait
for anything outside.
"""

from __future__ import annotations

import asyncio
import math
import selectors
from collections.abc import Callable, Coroutine
from contextvars import Context
from types import SimpleNamespace
from typing import Any, TypeVar

from deadtime._base.errors import LinkError
from deadtime.links.addresses import Address

T = TypeVar("T")

#: Ports for endpoints that ask for a free one.
FREE_PORTS = range(49152, 65536)


def run(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine as `asyncio.run` does, in virtual time that begins at zero.

    Raises
    ------
    LinkError
        If all tasks wait and no event is scheduled, so that the program would never end.

    Examples
    --------
    >>> import asyncio
    >>> async def an_hour():
    ...     await asyncio.sleep(3600.0)
    ...     return asyncio.get_running_loop().time()
    >>> run(an_hour())
    3600.0
    """
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(main)


class _Jump(selectors.DefaultSelector):
    """Advances the clock where a selector would wait; only the waker of the loop is registered."""

    def __init__(self) -> None:
        super().__init__()
        self.time = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)  # a signal, such as Ctrl-C
        if ready:
            return ready
        if timeout is None:
            raise LinkError(
                "all tasks wait, but no event is scheduled, so the program would never end"
            )
        self.time += max(timeout, 0.0)
        return []


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """The event loop of `run`."""

    def __init__(self) -> None:
        self._jump = _Jump()
        super().__init__(self._jump)
        self._datagrams: dict[Address, _Datagrams] = {}
        self._servers: dict[Address, _Server] = {}

    def time(self) -> float:
        """Seconds since the loop was made."""
        return self._jump.time

    def call_at(  # type: ignore[override]
        self,
        when: float,
        callback: Callable[..., object],
        *args: Any,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:
        """As in asyncio; an event at infinity is never scheduled."""
        if when == math.inf:
            return asyncio.TimerHandle(when, callback, args, self, context)
        return super().call_at(when, callback, *args, context=context)

    def _free(self, requested: Address, taken: dict[Address, Any]) -> Address:
        host, port = requested
        if port == 0:
            port = next(port for port in FREE_PORTS if (host, port) not in taken)
        elif (host, port) in taken:
            raise OSError(98, f"the address {host}:{port} is in use already: give another port")
        return host, port

    async def create_datagram_endpoint(  # type: ignore[override]
        self,
        protocol_factory: Callable[[], asyncio.DatagramProtocol],
        local_addr: Address | None = None,
        remote_addr: Address | None = None,
        **others: Any,
    ) -> tuple[asyncio.DatagramTransport, asyncio.DatagramProtocol]:
        """As in asyncio, between addresses of this loop."""
        local = self._free(local_addr or ("127.0.0.1", 0), self._datagrams)
        protocol = protocol_factory()
        transport = _Datagrams(self, protocol, local, remote_addr)
        self._datagrams[local] = transport
        self.call_soon(protocol.connection_made, transport)
        await asyncio.sleep(0)
        return transport, protocol

    async def create_server(  # type: ignore[override]
        self,
        protocol_factory: Callable[[], asyncio.Protocol],
        host: str | None = None,
        port: int | None = None,
        **others: Any,
    ) -> _Server:
        """As in asyncio, between addresses of this loop."""
        local = self._free((host or "127.0.0.1", port or 0), self._servers)
        self._servers[local] = _Server(self, protocol_factory, local)
        return self._servers[local]

    async def create_connection(  # type: ignore[override]
        self,
        protocol_factory: Callable[[], asyncio.Protocol],
        host: str | None = None,
        port: int | None = None,
        **others: Any,
    ) -> tuple[asyncio.Transport, asyncio.Protocol]:
        """As in asyncio, between addresses of this loop."""
        remote = (host or "127.0.0.1", port or 0)
        server = self._servers.get(remote)
        if server is None:
            raise ConnectionRefusedError(111, f"no endpoint listens on {remote[0]}:{remote[1]}")
        local = self._free((remote[0], 0), self._servers)
        near_protocol, far_protocol = protocol_factory(), server.protocol_factory()
        near = _Stream(self, near_protocol, local, remote)
        far = _Stream(self, far_protocol, remote, local)
        near.peer, far.peer = far, near
        self.call_soon(far_protocol.connection_made, far)
        self.call_soon(near_protocol.connection_made, near)
        await asyncio.sleep(0)
        return near, near_protocol


class _Datagrams(asyncio.DatagramTransport):
    """A datagram endpoint of a network without loss and delay."""

    def __init__(
        self,
        loop: VirtualTimeLoop,
        protocol: asyncio.DatagramProtocol,
        local: Address,
        remote: Address | None,
    ) -> None:
        super().__init__({"sockname": local, "peername": remote})
        self._loop, self._protocol = loop, protocol
        self._local, self._remote = local, remote
        self._closing = False

    def sendto(self, data: Any, addr: Any = None) -> None:
        if self._closing:
            return
        target = addr or self._remote
        if target is None:
            raise ValueError(
                "the datagram has no address: give an address, or connect the endpoint"
            )
        if len(data) > 65507:
            raise OSError(
                90, f"a datagram of {len(data)} bytes is too long: give at most 65507 bytes"
            )
        receiver = self._loop._datagrams.get((target[0], target[1]))
        if receiver is not None:
            self._loop.call_soon(receiver._receive, bytes(data), self._local)
        elif self._remote is not None:
            # As on one machine: a connected socket gets an error if nobody listens.
            error = ConnectionRefusedError(111, f"nobody receives at {target[0]}:{target[1]}")
            self._loop.call_soon(self._protocol.error_received, error)

    def _receive(self, data: bytes, sender: Address) -> None:
        if not self._closing and self._remote in (None, sender):
            self._protocol.datagram_received(data, sender)

    def close(self) -> None:
        if not self._closing:
            self._closing = True
            self._loop._datagrams.pop(self._local, None)
            self._loop.call_soon(self._protocol.connection_lost, None)

    def abort(self) -> None:
        self.close()

    def is_closing(self) -> bool:
        return self._closing


class _Stream(asyncio.Transport):
    """One end of a connection; data arrive at the other end in order."""

    peer: _Stream | None = None

    def __init__(
        self, loop: VirtualTimeLoop, protocol: asyncio.Protocol, local: Address, remote: Address
    ) -> None:
        super().__init__({"sockname": local, "peername": remote})
        self._loop, self._protocol = loop, protocol
        self._closing = False

    def write(self, data: Any) -> None:
        if not self._closing and self.peer is not None:
            self._loop.call_soon(self.peer._receive, bytes(data))

    def _receive(self, data: bytes) -> None:
        if not self._closing:
            self._protocol.data_received(data)

    def _end(self) -> None:
        """The other end sends no more data."""
        if self._closing:
            return
        if not self._protocol.eof_received():
            self.close()

    def write_eof(self) -> None:
        if self.peer is not None:
            self._loop.call_soon(self.peer._end)

    def close(self) -> None:
        if not self._closing:
            self._closing = True
            self._loop.call_soon(self._protocol.connection_lost, None)
            self.write_eof()

    def abort(self) -> None:
        self.close()

    def is_closing(self) -> bool:
        return self._closing

    def pause_reading(self) -> None:
        """Nothing to pause: data arrive at once."""

    def resume_reading(self) -> None:
        """Nothing to resume."""

    def get_write_buffer_size(self) -> int:
        return 0


class _Server(asyncio.AbstractServer):
    """A listener at one address."""

    def __init__(
        self,
        loop: VirtualTimeLoop,
        protocol_factory: Callable[[], asyncio.Protocol],
        local: Address,
    ) -> None:
        self._loop, self.protocol_factory, self._local = loop, protocol_factory, local
        self.sockets = (SimpleNamespace(getsockname=lambda: local),)

    def close(self) -> None:
        self._loop._servers.pop(self._local, None)

    def is_serving(self) -> bool:
        return self._local in self._loop._servers

    def get_loop(self) -> asyncio.AbstractEventLoop:
        return self._loop

    async def wait_closed(self) -> None:
        """Closing takes no time."""

    async def start_serving(self) -> None:
        """It has served from the start."""

    async def serve_forever(self) -> None:
        """Wait until it is cancelled."""
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            self.close()
