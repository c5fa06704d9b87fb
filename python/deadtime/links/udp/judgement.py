"""Whether the number and the clock of a packet go on from those before, the same at both ends.

No single packet moves them far: what lies far from all before is believed when the next such packet
agrees with it, as after an outage or a restart of the other end.
"""

from __future__ import annotations

import math

from deadtime.links.udp.classifier import REMEMBERED
from deadtime.links.udp.packets import LoopPacket

#: Most that a number may be ahead of the highest one.
AHEAD = REMEMBERED

#: Most by which an exchange may contradict the bounds of the clock offset, s: drift of hours.
DRIFT = 1.0


class Judgement:
    """Judges the packets of one stream.

    Examples
    --------
    >>> judgement = Judgement()
    >>> numbers = [1, 2, 4_000_000_000, 3, 9_000, 9_001]
    >>> [judgement.accepts(LoopPacket(n, 0.0), 0.0, False) for n in numbers]
    [True, True, False, True, False, True]
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget what came before."""
        self._highest: int | None = None
        self._bounds = (-math.inf, math.inf)
        self._doubted: tuple[int, tuple[float, float]] | None = None

    def accepts(self, packet: LoopPacket, now: float, is_answer: bool) -> bool:
        """Whether a packet that was read at `now` is believed."""
        bounds = (-math.inf, math.inf)
        if is_answer:  # of the offset of the other clock
            bounds = packet.sent - now, packet.sent - packet.held - packet.echo_sent
        number, before = packet.sequence, self._highest
        agrees = before is None or number <= before + AHEAD
        if not (agrees and meet(bounds, self._bounds)):
            doubted, self._doubted = self._doubted, (number, bounds)
            if doubted is None or not (
                0 < number - doubted[0] <= AHEAD and meet(bounds, doubted[1])
            ):
                return False
            self._highest, self._bounds = None, (-math.inf, math.inf)
        self._doubted = None
        self._highest = max(number, self._highest or 0)
        self._bounds = narrowed(self._bounds, bounds)
        return True


def meet(bounds: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two pairs of bounds can be of one clock."""
    return max(bounds[0], other[0]) <= min(bounds[1], other[1]) + DRIFT


def narrowed(before: tuple[float, float], newest: tuple[float, float]) -> tuple[float, float]:
    """What both pairs of bounds allow; the newest if a clock has drifted out of those before."""
    low, high = max(newest[0], before[0]), min(newest[1], before[1])
    return (low, high) if low <= high else newest
