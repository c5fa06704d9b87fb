"""The socket of a link: datagrams, a stream or a serial port, to and from one peer."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.serial_port import SerialPort

#: Longest time for a connection to be accepted, s.
CONNECTING = 5.0

#: Called with what is received, who sent it, and whether it is a datagram.
Receive = Callable[[bytes, Any, bool], None]


class LinkSocket:
    """What carries the bytes of a link.

    A socket that waits for datagrams sends to nobody until `answer` names the peer: the one that
    has sent a frame of the vehicle. Datagrams of others are still passed on with their sender.
    """

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._datagrams: asyncio.DatagramTransport | None = None
        self._stream: asyncio.Transport | None = None
        self._serial: SerialPort | None = None
        self.peer: Any = None

    async def open(self, address: LinkAddress) -> None:
        """Open it.

        Raises
        ------
        LinkError
            If the address cannot be used, or nothing accepts a connection there.
        MissingExtraError
            If it is a serial port, and pyserial is not installed.
        """
        if address.kind == "serial":
            self._serial = SerialPort(
                address.host, address.port, lambda data: self._receive(data, None, False)
            )
            return
        loop, place = asyncio.get_running_loop(), (address.host, address.port)
        try:
            if address.kind == "tcp":
                async with asyncio.timeout(CONNECTING):
                    self._stream, _ = await loop.create_connection(
                        lambda: _Stream(self._receive), *place
                    )
            elif address.kind == "udpout":
                self._datagrams, _ = await loop.create_datagram_endpoint(
                    lambda: _Datagrams(self._receive), remote_addr=place
                )
            else:
                self._datagrams, _ = await loop.create_datagram_endpoint(
                    lambda: _Datagrams(self._receive), local_addr=place
                )
        except (OSError, TimeoutError) as error:
            reason = str(error) or f"no answer has come within {CONNECTING:g} s"
            raise LinkError(f"{address} cannot be opened: {reason}") from None
        self._connected = address.kind != "udp"

    def answer(self, peer: Any) -> None:
        """Send to this peer from now on."""
        self.peer = peer

    def send(self, data: bytes) -> None:
        """Send, if a peer is known."""
        if self._serial is not None:
            self._serial.send(data)
        elif self._stream is not None and not self._stream.is_closing():
            self._stream.write(data)
        elif self._datagrams is not None and not self._datagrams.is_closing():
            if self._connected:
                self._datagrams.sendto(data)
            elif self.peer is not None:
                self._datagrams.sendto(data, self.peer)

    def close(self) -> None:
        """Close it."""
        for transport in (self._datagrams, self._stream, self._serial):
            if transport is not None:
                transport.close()


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, receive: Receive) -> None:
        self._receive = receive

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self._receive(data, tuple(addr[:2]), True)

    def error_received(self, exc: Exception) -> None:
        """A refused datagram counts as lost; the following silence is detected."""


class _Stream(asyncio.Protocol):
    """A stream; where it ends, the following silence is detected."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive

    def data_received(self, data: bytes) -> None:
        self._receive(data, None, False)
