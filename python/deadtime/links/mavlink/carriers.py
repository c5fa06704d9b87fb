"""Several links to one vehicle: one is used, the others stand by.

A loop has the delay of the link that it is closed over, so the vehicle is read and commanded over
one link at a time. Set points over two would let the slower link bring back old ones. Heartbeats
and TIMESYNC go over all. Where nothing has come over the link in use for `SILENT` seconds and
others are heard, that with the shortest round trip takes over. It stays in use until it falls
silent in turn.

System ids tell vehicles apart, and most have the id 1. Where the clock over a link is another one
than over the link in use, another vehicle is at its end: it never takes over.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from deadtime.links.mavlink.carrier import Carrier

#: Silence after which another link takes over, s: before a state is too old for a flight to go on,
#: and ten of its messages. And that after which a link that stands by is named, s.
SILENT, NAMED = 0.2, 2.0

#: Difference of two clocks beyond what their round trips leave open, s: they are of two vehicles.
APART = 0.05

#: Time for the first heartbeat on the first link, before another one is taken, s.
FIRST = 1.2


class Carriers:
    """The links to one vehicle, in the order in which they are preferred at first.

    Parameters
    ----------
    all_of_them : sequence of Carrier
    tell : callable
        Called with what happens to a link, in words.
    switched : callable
        Called when another link is used.

    Attributes
    ----------
    current : Carrier
        The link in use.
    """

    def __init__(
        self,
        all_of_them: Sequence[Carrier],
        tell: Callable[[str], None],
        switched: Callable[[], None],
    ) -> None:
        self._all, self._tell, self._switched = tuple(all_of_them), tell, switched
        self.current = self._all[0]
        self._held = False

    def __iter__(self) -> Iterator[Carrier]:
        return iter(self._all)

    @property
    def other_vehicles(self) -> list[Carrier]:
        """Links over which another vehicle answers than over the one in use."""
        return [carrier for carrier in self._all if not _same_clock(carrier, self.current)]

    def look(self) -> None:
        """Name links that have fallen silent, and use another one if the one in use has."""
        alive = [
            link
            for link in self._all
            if link.heard is not None and link.silent < SILENT and _same_clock(link, self.current)
        ]
        patience = FIRST if self.current.heard is None else SILENT
        if not self._held and self.current.silent > patience and alive:
            lost, best = self.current, min(alive, key=_round_trip)
            self._use(best)
            lost.named = True
            self._tell(
                f"{lost.address}: nothing has been received for {lost.silent:.1f} s. The "
                f"vehicle is now reached over {best.address}"
            )
        for link in self._all:
            if link in alive:
                link.named = False
            elif link is not self.current and link.silent > NAMED and not link.named:
                link.named = True
                self._tell(
                    f"{link.address}: nothing has been received for {link.silent:.1f} s. This "
                    "link was in reserve"
                )

    @contextmanager
    def over(self, carrier: Carrier) -> Iterator[None]:
        """Use this link for a while."""
        before, self._held = self.current, True
        self._use(carrier)
        try:
            yield
        finally:
            self._held = False
            self._use(before)

    def _use(self, carrier: Carrier) -> None:
        if carrier is not self.current:
            self.current = carrier
            self._switched()


def _same_clock(carrier: Carrier, other: Carrier) -> bool:
    """Whether the vehicle at both may be the same one."""
    some, others = carrier.time_sync.link_time, other.time_sync.link_time
    if some is None or others is None:
        return True
    return abs(some.offset - others.offset) <= 0.5 * (some.least + others.least) + APART


def _round_trip(carrier: Carrier) -> float:
    measured = carrier.time_sync.link_time
    return math.inf if measured is None else measured.median
