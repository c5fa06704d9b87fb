"""The packets between the plant and the controller of a loop over UDP."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Self

from deadtime.links._native import doubles_read, doubles_write, loop_packet_read, loop_packet_write


@dataclass(frozen=True)
class LoopPacket:
    """A sample for the controller, or a command for the plant: 56 bytes.

    Attributes
    ----------
    sequence : int
        Number of the packet, counted from 1; 32 bits.
    sent : float
        When it was sent, s of its sender's clock.
    echo_sequence : int
        Number of the packet that this one answers, 0 for none.
    echo_sent : float
        When that one was sent, s of its sender's clock.
    held : float
        Time between receiving that one and sending this one, s.
    value : float
        The output, or the command.
    reference : float
        The reference.
    flags : int
        32 bits, defined by the two ends.

    Examples
    --------
    >>> answer = LoopPacket(2, 10.0, echo_sequence=1, echo_sent=3.5, held=0.001, value=0.25)
    >>> LoopPacket.decode(answer.encode()) == answer
    True
    """

    sequence: int
    sent: float
    echo_sequence: int = 0
    echo_sent: float = 0.0
    held: float = 0.0
    value: float = 0.0
    reference: float = 0.0
    flags: int = 0

    def encode(self) -> bytes:
        """Write the packet.

        Raises
        ------
        ValueError
            If a number is not finite, `held` is negative, or an integer has more than 32 bits.
        """
        try:
            return loop_packet_write(**vars(self))
        except OverflowError as error:
            raise ValueError(f"{self}: {error}") from None

    @classmethod
    def decode(cls, packet: bytes) -> Self:
        """Read a packet.

        Raises
        ------
        PacketError
            If it has another length or header, or a number in it is not finite.
        """
        found = loop_packet_read(packet)
        return cls(**{field.name: getattr(found, field.name) for field in fields(cls)})


def encode_doubles(values: Iterable[float]) -> bytes:
    """Write plain little-endian doubles, as Simulink's UDP blocks send them.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    return doubles_write(list(values))


def decode_doubles(data: bytes, count: int) -> tuple[float, ...]:
    """Read `count` plain little-endian doubles.

    Raises
    ------
    PacketError
        If there are more or fewer bytes, or a number is not finite.

    Examples
    --------
    >>> decode_doubles(encode_doubles([1.0, -2.5]), 2)
    (1.0, -2.5)
    """
    return tuple(doubles_read(data, count))
