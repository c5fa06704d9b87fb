"""A UDP endpoint with one peer, which processes received packets in batches."""

from __future__ import annotations

import asyncio
import ipaddress
import math
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any, cast

from deadtime._base.errors import LinkError, PacketError
from deadtime.links.addresses import Address, canonical, for_socket, is_loopback
from deadtime.links.udp.classifier import REMEMBERED, Classifier, Verdict
from deadtime.links.udp.judgement import Judgement
from deadtime.links.udp.packets import LoopPacket
from deadtime.links.udp.statistics import LinkStatistics
from deadtime.links.udp.wires import SAFE, Wire

#: Largest batch, so that a flood does not delay its processing.
LARGEST_BATCH = 64


class Socket(asyncio.DatagramProtocol):
    """A UDP socket of the running loop that passes on datagrams with the `canonical` sender."""

    def __init__(self, receive: Callable[[bytes, Address], None]) -> None:
        self._receive = receive
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio."""
        self._transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
        """Called by asyncio."""
        self._receive(data, (canonical(addr[0]), addr[1]))

    def error_received(self, exc: Exception) -> None:
        """Called by asyncio: nobody listens (yet), which the watchdogs handle."""

    @property
    def address(self) -> Address:
        """The address of this socket."""
        assert self._transport is not None
        host, port = self._transport.get_extra_info("sockname")[:2]
        return host, port

    def send(self, data: bytes, address: Address) -> None:
        """Send a datagram."""
        if self._transport is not None and not self._transport.is_closing():
            self._transport.sendto(data, for_socket(address, self.address[0]))

    def close(self) -> None:
        """Close the socket."""
        if self._transport is not None:
            self._transport.close()


async def open_socket(receive: Callable[[bytes, Address], None], address: Address) -> Socket:
    """A socket that listens on this address; port 0 takes a free one."""
    loop = asyncio.get_running_loop()
    try:
        _, socket = await loop.create_datagram_endpoint(lambda: Socket(receive), local_addr=address)
    except OSError as error:
        raise LinkError(
            f"no UDP socket can be opened on {address[0]}:{address[1]}: "
            f"{error.strerror or error}. Give a port that is free, or 0 for any free port"
        ) from None
    if not is_loopback(address[0]):
        print(
            f"the endpoint listens on {address[0]}, so every host that reaches this port can "
            "send packets to it",
            file=sys.stderr,
        )
    return socket


def speaking_to(address: Address) -> Address:
    """The narrowest address to bind a socket that sends to a numeric address."""
    target = ipaddress.ip_address(address[0])
    if target.is_loopback:  # a socket on the loopback cannot send elsewhere
        return ("127.0.0.1" if target.version == 4 else "::1"), 0
    return ("0.0.0.0" if target.version == 4 else "::"), 0


async def resolved(address: Address) -> Address:
    """The `canonical` address that datagrams from this host come from; of a name, the IPv4 one.

    Raises
    ------
    LinkError
        When the host has no such address, or the port is 0.
    """
    host, port = address
    if port == 0:
        raise LinkError(
            f"nothing can be sent to port 0 of {host}: give the port on which the other end listens"
        )
    try:
        ipaddress.ip_address(host)
    except ValueError:
        loop = asyncio.get_running_loop()
        try:
            found = await loop.getaddrinfo(host, port)
        except OSError as error:
            raise LinkError(
                f"the host {host!r} is not known: {error.strerror}. Give its IPv4 address"
            ) from None
        numeric = [entry[4][0] for entry in found if ":" not in str(entry[4][0])]
        if not numeric:
            raise LinkError(f"the host {host!r} has no IPv4 address") from None
        return str(numeric[0]), port
    return canonical(host), port


class Endpoint:
    """The socket of one end of the loop: checks the peer, decodes and classifies packets.

    Parameters
    ----------
    wire : Wire
        The wire format.
    take : callable
        Called with the packets of a batch and the times at which they were read. A batch ends with
        a pass of the event loop in which nothing arrived.
    peer : (str, int), optional
        The other end; by default the sender of the first valid packet.
    answers_only : bool
        Accept answers to packets of this end only. Plain doubles have no echo and are all accepted.
    remembered : int
        Number of sent packets that can be answered.
    """

    def __init__(
        self,
        wire: Wire,
        take: Callable[[list[tuple[LoopPacket, float]]], None],
        peer: Address | None = None,
        *,
        answers_only: bool = False,
        remembered: int = REMEMBERED,
    ) -> None:
        self.statistics = LinkStatistics()
        self._classifier = Classifier(remembered)
        self._judgement = Judgement()
        self._answers_only = answers_only and wire.has_times
        self._wire, self._take = wire, take
        self._fixed_peer = peer
        self.peer = peer
        self._batch: list[tuple[LoopPacket, float]] = []
        self._socket: Socket | None = None
        self._failure: Exception | None = None

    async def open(self, address: Address) -> None:
        """Open the socket on this address; port 0 takes a free one."""
        self._loop = asyncio.get_running_loop()
        self._closed = asyncio.Event()
        if self._fixed_peer is not None:
            self._fixed_peer = self.peer = await resolved(self._fixed_peer)
        self._socket = await open_socket(self._receive, address)

    @property
    def address(self) -> Address:
        """The address of this end."""
        if self._socket is None:
            raise LinkError("the endpoint is not open: call open() first")
        return self._socket.address

    def forget_peer(self) -> None:
        """Accept another peer, or the same one after a restart."""
        self.peer = self._fixed_peer
        self.statistics.restart()
        self._judgement.restart()

    def send(self, packet: LoopPacket) -> None:
        """Send a packet to the peer, if there is one."""
        self._classifier.sent(packet.sequence, packet.sent)
        if self._socket is not None and self.peer is not None:
            self._socket.send(self._wire.encode(packet), self.peer)

    def close(self) -> None:
        """Close the socket and drop the current batch."""
        if self._socket is not None:
            self._socket.close()
            self._closed.set()
        self._batch.clear()

    def fail(self, error: Exception) -> None:
        """Close the socket because of an error, which `running` raises."""
        self._failure = self._failure or error
        self.close()

    async def running(self, time: float) -> None:
        """Wait for `time` seconds, or until the endpoint fails; raises its error then."""
        with suppress(TimeoutError):
            async with asyncio.timeout(None if math.isinf(time) else time):
                await self._closed.wait()
        self.check()

    def check(self) -> None:
        """Raise the error of the endpoint, if it has failed."""
        if self._failure is not None:
            raise self._failure

    def _receive(self, data: bytes, address: Address) -> None:
        if self._closed.is_set():
            return
        now = self._loop.time()
        if self.peer is not None and address != self.peer:
            self.statistics.foreign += 1
            return
        try:
            packet = self._wire.decode(data)
        except PacketError:
            self.statistics.invalid += 1
            return
        verdict = self._classifier.of(packet, now)
        answers = verdict is Verdict.ANSWER
        if verdict is Verdict.IMPOSSIBLE or (self._answers_only and not answers):
            self.statistics.invalid += 1
            return
        # A safe command answers one packet again and again: its times are no exchange.
        is_exchange = answers and not packet.flags & SAFE
        if not self._judgement.accepts(packet, now, is_exchange):
            self.statistics.invalid += 1
            return
        self.peer = address
        if not self.statistics.arrived(packet):
            return
        if is_exchange:
            self.statistics.exchanged(packet, now)
        self._batch.append((packet, now))
        if len(self._batch) == 1:
            self._loop.call_soon(self._look_again, 0)
        elif len(self._batch) >= LARGEST_BATCH:
            self._hand_over()

    def _look_again(self, before: int) -> None:
        """Process the batch once a whole pass of the event loop added nothing to it.

        A selector loop reads one datagram of a socket in each pass, after the due callbacks, so
        only the second check sees all waiting datagrams.
        """
        if not self._batch:
            return
        if len(self._batch) > before:
            self._loop.call_soon(self._look_again, len(self._batch))
        else:
            self._hand_over()

    def _hand_over(self) -> None:
        batch, self._batch = self._batch, []
        try:
            self._take(batch)
        except Exception as error:
            # In a callback the event loop would only print the error.
            self.fail(error)
