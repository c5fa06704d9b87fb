"""What is heard on a MAVLink link of others: the set points and the positions of a vehicle."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.links.mavlink.senders import Senders
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
    address: LinkAddress,
    axis: str,
    silence: float,
    key: bytes | None = None,
    system: int | None = None,
) -> Iterator[Row | Sent]:
    """Set points and positions on a MAVLink link, until nothing has come for `silence` s.

    The socket only receives: nothing is ever sent. Whoever routes the link has to pass on the
    messages to the vehicle as well as those from it. Positions of others, and set points to
    others, are left out, and so are numbers that are not finite.

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
    system : int, optional
        The MAVLink system of the vehicle; without it, that of the first heartbeat of an autopilot.

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
        raise ValueError(f"{address}: only listening is possible here, so give udp:HOST:PORT")
    codec, begun = Codec(255, 0, key), time.monotonic()
    vehicle = Senders((255, 0), system)
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    with closing(socket.socket(family, socket.SOCK_DGRAM)) as ears:
        try:
            ears.bind((address.host, address.port))
        except OSError as error:
            raise LinkError(f"{address} cannot be opened: {error}") from None
        ears.settimeout(LOOK)
        last = since = -LATER
        while last - since <= silence:
            try:
                data = ears.recv(DATAGRAM)
            except TimeoutError:
                last = max(last, time.monotonic() - begun)
                continue
            now = last = max(time.monotonic() - begun, last + LATER)
            for message in codec.decode(data, whole=True):
                found = _event(message, vehicle, axis, now)
                if found is not None:
                    since = now
                    yield found
                now = last = last + LATER


def _event(message: Any, vehicle: Senders, axis: str, now: float) -> Row | Sent | None:
    """What a message says about the vehicle and the axis, if anything."""
    position, speed, sign = AXES[axis]
    kind, is_own = message.get_type(), vehicle.is_vehicle(message)
    if kind == "LOCAL_POSITION_NED" and is_own:
        value = sign * float(getattr(message, position))
        return Row(now, value, None) if math.isfinite(value) else None
    if kind == "SET_POSITION_TARGET_LOCAL_NED" and message.target_system in (0, vehicle.vehicle):
        no_speed = dialect().POSITION_TARGET_TYPEMASK_VZ_IGNORE
        ignored = {"x": no_speed >> 2, "y": no_speed >> 1, "z": no_speed}[axis]
        value = sign * float(getattr(message, speed))
        if not message.type_mask & ignored and math.isfinite(value):
            return Sent(now, value)
    return None
