"""Classification of received packets, the same at both ends of the loop.

A packet is plausible if its numbers are possible for a clock and a recording. It is an answer if it
also echoes a packet of this end with its time, and was held for no longer than possible. A
plausible packet that is no answer may be from a restarted end that still echoes an earlier one; its
times are not used.
"""

from __future__ import annotations

from collections import deque
from enum import Enum

from deadtime.links.udp.packets import LoopPacket
from deadtime.recordings import LARGEST

#: Number of remembered packets, sent or received.
REMEMBERED = 4096

#: Largest plausible time of a clock, s: beyond it a double no longer resolves microseconds.
LATEST = 2.0**33


class Verdict(Enum):
    """Class of a packet."""

    IMPOSSIBLE = "the packet has impossible values"
    PLAUSIBLE = "the packet is plausible, but does not answer a packet of this end"
    ANSWER = "the packet answers a packet of this end"


class Classifier:
    """Classifies received packets by the sent ones.

    Parameters
    ----------
    remembered : int
        Number of sent packets that can be answered.

    Examples
    --------
    >>> classifier = Classifier()
    >>> classifier.sent(7, 1.0)
    >>> answer = LoopPacket(1, sent=500.0, echo_sequence=7, echo_sent=1.0, held=0.01)
    >>> classifier.of(answer, now=1.1)
    <Verdict.ANSWER: 'the packet answers a packet of this end'>
    >>> classifier.of(answer, now=1.001)  # held for longer than the round trip
    <Verdict.PLAUSIBLE: 'the packet is plausible, but does not answer a packet of this end'>
    """

    def __init__(self, remembered: int = REMEMBERED) -> None:
        self._remembered = remembered
        self._times: dict[int, float] = {}
        self._order: deque[int] = deque()

    def sent(self, number: int, time: float) -> None:
        """Note that the packet of this number was sent."""
        self._times[number] = time
        self._order.append(number)
        if len(self._order) > self._remembered:
            del self._times[self._order.popleft()]

    def of(self, packet: LoopPacket, now: float) -> Verdict:
        """The class of a packet that was read at `now`."""
        largest = max(abs(packet.value), abs(packet.reference))
        if not (largest <= LARGEST and abs(packet.sent) <= LATEST and packet.held >= 0.0):
            return Verdict.IMPOSSIBLE
        own = self._times.get(packet.echo_sequence) == packet.echo_sent
        if own and packet.held <= now - packet.echo_sent:
            return Verdict.ANSWER
        return Verdict.PLAUSIBLE
