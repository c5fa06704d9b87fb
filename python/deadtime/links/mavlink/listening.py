"""What is heard on a MAVLink link of others: the set points and the positions of a vehicle."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import closing

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.recordings import Row, Sent

#: Longest time that the socket waits at once, s.
LOOK = 0.1

#: Largest datagram, bytes.
DATAGRAM = 65535

#: Message fields of an axis: its position, its set point of speed, and the sign of both.
AXES = {"x": ("x", "vx", 1.0), "y": ("y", "vy", 1.0), "z": ("z", "vz", -1.0)}

#: Later by at least so much than what came before, s: two messages may come at once.
LATER = 1e-6


def heard_rows(
    address: LinkAddress, axis: str, silence: float, key: bytes | None = None
) -> Iterator[Row | Sent]:
    """Set points and positions on a MAVLink link, until nothing has come for `silence` s.

    The socket only receives: nothing is ever sent. Whoever routes the link has to pass on the
    messages to the vehicle as well as those from it.

    Parameters
    ----------
    address : LinkAddress
        Where the messages arrive, of kind ``udp``.
    axis : {"x", "y", "z"}
        The position to the north, to the east, or the height.
    silence : float
        How long it is waited for another message of the axis, s; infinity for ever.
    key : bytes, optional
        Signing key, 32 bytes: unsigned frames are refused then.

    Yields
    ------
    Row or Sent
        A position, m, without a command; a commanded speed, m/s. Times are in s from the call.

    Raises
    ------
    ValueError
        If the address is of another kind, or the key has another length.
    LinkError
        If it cannot be opened.
    """
    if address.kind != "udp":
        raise ValueError(f"{address}: give udp:HOST:PORT, at which a link is listened to")
    position, speed, sign = AXES[axis]
    codec, begun = Codec(255, 0, key), time.monotonic()
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    with closing(socket.socket(family, socket.SOCK_DGRAM)) as ears:
        try:
            ears.bind((address.host, address.port))
        except OSError as error:
            raise LinkError(f"{address} cannot be opened: {error}") from None
        ears.settimeout(LOOK)
        last = since = -LATER
        no_speed = dialect().POSITION_TARGET_TYPEMASK_VZ_IGNORE
        ignored = {"x": no_speed >> 2, "y": no_speed >> 1, "z": no_speed}[axis]
        while last - since <= silence:
            try:
                data = ears.recv(DATAGRAM)
            except TimeoutError:
                last = max(last, time.monotonic() - begun)
                continue
            now = last = max(time.monotonic() - begun, last + LATER)
            for message in codec.decode(data, whole=True):
                kind = message.get_type()
                if kind == "LOCAL_POSITION_NED":
                    since = now
                    yield Row(now, sign * float(getattr(message, position)), None)
                elif kind == "SET_POSITION_TARGET_LOCAL_NED" and not message.type_mask & ignored:
                    since = now
                    yield Sent(now, sign * float(getattr(message, speed)))
                now = last = last + LATER
