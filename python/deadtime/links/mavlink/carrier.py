"""One of the links to a vehicle: what carries its bytes, their codec, and its round trip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from deadtime.links.clock import now
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.links.mavlink.senders import Senders
from deadtime.links.mavlink.sockets import LinkSocket
from deadtime.links.mavlink.time_sync import TimeSync


class Carrier:
    """A link over one address.

    Parameters
    ----------
    address : LinkAddress
    codec : Codec
        Its own: frames are numbered, signed and cut from a stream link by link.
    senders : Senders
        Tells whose messages they are.
    take : callable
        Called with this link, a message of the vehicle, and the time of its arrival, s.

    Attributes
    ----------
    time_sync : TimeSync
        Its round trip.
    heard : float or None
        When the vehicle was last heard on it, s.
    named : bool
        Whether its silence was told.
    """

    def __init__(
        self,
        address: LinkAddress,
        codec: Codec,
        senders: Senders,
        take: Callable[[Carrier, Any, float], None],
    ) -> None:
        self.address, self.codec, self.time_sync = address, codec, TimeSync()
        self.heard: float | None = None
        self.named = False
        self._senders, self._take = senders, take
        self._socket = LinkSocket(self._receive)
        self._opened = 0.0

    @property
    def silent(self) -> float:
        """Time since the vehicle was heard on it, or since it was opened, s."""
        return now() - (self._opened if self.heard is None else self.heard)

    async def open(self) -> None:
        """Open it.

        Raises
        ------
        LinkError
            If it cannot be opened.
        """
        await self._socket.open(self.address)
        self._opened = now()

    def close(self) -> None:
        """Close it."""
        self._socket.close()

    def send(self, message: Any) -> None:
        """Send a message at once."""
        self._socket.send(self.codec.encode(message))

    def send_heartbeat(self) -> None:
        """Send the heartbeat of a ground station."""
        d = dialect()
        self.send(
            d.MAVLink_heartbeat_message(
                d.MAV_TYPE_GCS, d.MAV_AUTOPILOT_INVALID, 0, 0, d.MAV_STATE_ACTIVE, 3
            )
        )

    def send_time_sync(self) -> None:
        """Ask for the time of the vehicle."""
        if self._senders.vehicle is not None:
            self.send(dialect().MAVLink_timesync_message(0, self.time_sync.request(now())))

    def _receive(self, data: bytes, sender: Any, whole: bool) -> None:
        time = now()
        known = self._socket.peer
        if known is not None and sender != known:
            self._senders.elsewhere += 1
            return
        for message in self.codec.decode(data, whole):
            if not self._senders.is_vehicle(message):
                continue
            if known is None and sender is not None:
                known = sender
                self._socket.answer(sender)
                self.send_heartbeat()
            self.heard = time
            if message.get_type() == "TIMESYNC":
                self._take_time_sync(message, time)
            self._take(self, message, time)

    def _take_time_sync(self, message: Any, time: float) -> None:
        if message.tc1 == 0:
            self.send(dialect().MAVLink_timesync_message(round(time * 1e9), message.ts1))
        else:
            self.time_sync.answered(message.ts1, message.tc1, time)
