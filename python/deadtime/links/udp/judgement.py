"""Which packets are believed: one judgement for both ends of the loop.

A packet is news if its numbers can be those of a clock and of a recording. It is an answer if it
also echoes a packet that this end has sent, at the time at which it was sent, and says that it was
held for no longer than can be. News that are no answer may come from an end that was started anew
and still echoes the one before; their times are not used.
"""

from __future__ import annotations

from collections import deque
from enum import Enum

from deadtime.links.udp.packets import LoopPacket
from deadtime.recordings._recording import LARGEST

__all__ = ["REMEMBERED", "Judgement", "Verdict"]

#: Packets that are remembered, sent or received.
REMEMBERED = 4096

#: Largest time that a clock shows, s. Beyond it a double no longer tells microseconds.
LATEST = 2.0**33


class Verdict(Enum):
    """What a packet is."""

    IMPOSSIBLE = "it says what cannot be"
    NEWS = "it may be true, and answers nothing that was sent"
    ANSWER = "it answers what was sent"


class Judgement:
    """Knows what was sent, and judges what comes by it.

    Parameters
    ----------
    remembered : int
        How many of the packets sent can be answered.

    Examples
    --------
    >>> judge = Judgement()
    >>> judge.sent(7, 1.0)
    >>> answer = LoopPacket(1, sent=500.0, echo_sequence=7, echo_sent=1.0, held=0.01)
    >>> judge.of(answer, now=1.1)
    <Verdict.ANSWER: 'it answers what was sent'>
    >>> judge.of(answer, now=1.001)  # held for longer than it was away
    <Verdict.NEWS: 'it may be true, and answers nothing that was sent'>
    """

    def __init__(self, remembered: int = REMEMBERED) -> None:
        self._remembered = remembered
        self._times: dict[int, float] = {}
        self._order: deque[int] = deque()

    def sent(self, number: int, time: float) -> None:
        """Take in that the packet of this number was sent."""
        self._times[number] = time
        self._order.append(number)
        if len(self._order) > self._remembered:
            del self._times[self._order.popleft()]

    def of(self, packet: LoopPacket, now: float) -> Verdict:
        """What a packet is that was read now."""
        largest = max(abs(packet.value), abs(packet.reference))
        if not (largest <= LARGEST and abs(packet.sent) <= LATEST and packet.held >= 0.0):
            return Verdict.IMPOSSIBLE
        own = self._times.get(packet.echo_sequence) == packet.echo_sent
        if own and packet.held <= now - packet.echo_sent:
            return Verdict.ANSWER
        return Verdict.NEWS
