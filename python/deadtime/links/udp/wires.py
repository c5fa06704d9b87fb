"""The two wire formats of a loop packet: with time stamps, or as plain doubles.

Simulink's UDP blocks send doubles one after the other, without a header. Such a packet has
neither a time nor the number it answers; it is numbered in the order of arrival, and gives no round
trip.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

from deadtime._base.validation import whole_number
from deadtime.links.udp.packets import LoopPacket, decode_doubles, encode_doubles

#: Flag of a packet with the safe command of the controller, which is no answer.
SAFE = 1


@dataclass
class Stamped:
    """Packets with number, time stamp, echo and processing time."""

    has_times: ClassVar[bool] = True

    def encode(self, packet: LoopPacket) -> bytes:
        """Bytes of a packet."""
        return packet.encode()

    def decode(self, data: bytes) -> LoopPacket:
        """The packet in these bytes; raises PacketError if there is none."""
        return LoopPacket.decode(data)


@dataclass
class Doubles:
    """Plain little-endian doubles, as Simulink's UDP blocks send them.

    Parameters
    ----------
    incoming, outgoing : int
        Doubles in a datagram from and to the other end: the value, the reference where there are
        two, and zeros.

    Examples
    --------
    >>> from deadtime.links.udp import Doubles
    >>> Doubles(incoming=1, outgoing=2).decode(bytes(8)).value
    0.0
    """

    incoming: int = 1
    outgoing: int = 1
    has_times: ClassVar[bool] = False
    _count: int = field(default=0, repr=False)

    def __post_init__(self) -> None:
        whole_number("incoming", self.incoming, limit=129)
        whole_number("outgoing", self.outgoing, limit=129)

    def encode(self, packet: LoopPacket) -> bytes:
        """Bytes of a packet."""
        values = [packet.value, packet.reference][: self.outgoing]
        return encode_doubles(values + [0.0] * (self.outgoing - len(values)))

    def decode(self, data: bytes) -> LoopPacket:
        """The packet in these bytes; raises PacketError if there is none."""
        values = decode_doubles(data, self.incoming)
        self._count += 1
        reference = values[1] if len(values) > 1 else 0.0
        return LoopPacket(self._count, sent=0.0, value=values[0], reference=reference)


#: A wire format of loop packets.
Wire: TypeAlias = Stamped | Doubles


def wire_of(doubles: tuple[int, int] | None) -> Wire:
    """The wire format with these numbers of plain doubles from and to the other end, if any."""
    return Stamped() if doubles is None else Doubles(*doubles)
