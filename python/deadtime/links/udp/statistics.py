"""Measured statistics of the network from a stream of packets.

Every packet echoes the number and the time stamp of the one it answers, and states how long that
was held before the answer. With the four times of such an exchange (sent t0, received there t1,
answered there t2, received here t3; t0 and t3 by this clock, t1 and t2 by the other)

    round trip = (t3 - t0) - (t2 - t1),

independent of the offset of the clocks. Its division into the two directions cannot be measured;
but neither delay is negative, which bounds the offset of the clocks, and with it each delay.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from deadtime.links.udp.classifier import REMEMBERED
from deadtime.links.udp.judgement import meet, narrowed
from deadtime.links.udp.packets import LoopPacket

#: Number of newest packets whose times are kept (bounds memory in runs of days).
KEPT = 100_000

#: Smallest width of a bin, s: the resolution of clocks.
NARROWEST = 1e-6

#: Weight of each packet in the running jitter (RFC 3550, section 6.4.1).
JITTER_PART = 1.0 / 16.0


@dataclass(frozen=True)
class Percentiles:
    """Summary of a sample of times, s; NaN for an empty one.

    Attributes
    ----------
    count : int
        Number of values.
    mean, p50, p95, p99, largest : float
        Mean, median, percentiles and maximum, s.
    """

    count: int
    mean: float
    p50: float
    p95: float
    p99: float
    largest: float

    @staticmethod
    def of(values: Sequence[float]) -> Percentiles:
        """The summary of a sample."""
        if not len(values):
            return Percentiles(0, *[math.nan] * 5)
        p50, p95, p99, largest = np.percentile(values, [50.0, 95.0, 99.0, 100.0]).tolist()
        return Percentiles(len(values), float(np.mean(values)), p50, p95, p99, largest)


def histogram(values: Sequence[float], bins: int = 20) -> tuple[list[float], list[int]]:
    """Edges (s) and counts of a sample, from its smallest to its largest value."""
    if not len(values):
        return [], []
    low, high = min(values), max(values)
    counts, edges = np.histogram(values, bins, (low, max(high, low + bins * NARROWEST)))
    return edges.tolist(), counts.tolist()


@dataclass
class ClockOffset:
    """Offset of another clock against this one, from the four times of many exchanges.

    As in MAVLink's TIMESYNC, but with a bound: ``other clock = this clock + offset``. Each exchange
    shows that the offset is at most ``t1 - t0`` and at least ``t2 - t3``; the intersection is kept.
    With a clock that drifts it becomes empty: then the bounds of the newest exchange are kept.

    Examples
    --------
    The other clock is 100 s ahead; the delays are 3 ms to it and 1 ms back:

    >>> from deadtime.links.udp import ClockOffset
    >>> clock = ClockOffset()
    >>> clock.add(5.0, 105.003, 105.004, 5.005)
    >>> round(clock.offset, 4), round(clock.uncertainty, 4)
    (100.001, 0.002)
    """

    most: float = math.inf
    least: float = -math.inf

    def add(self, t0: float, t1: float, t2: float, t3: float) -> None:
        """Add an exchange: sent, received there, answered there, received here."""
        self.least, self.most = narrowed((self.least, self.most), (t2 - t3, t1 - t0))

    def agrees(self, t0: float, t1: float, t2: float, t3: float) -> bool:
        """Whether an exchange can be of the same clock as those before."""
        return meet((self.least, self.most), (t2 - t3, t1 - t0))

    @property
    def offset(self) -> float:
        """The middle of the possible offsets, s; NaN before the first exchange."""
        return 0.5 * (self.most + self.least) if math.isfinite(self.most) else math.nan

    @property
    def uncertainty(self) -> float:
        """Largest error of `offset` by any division of the round trip, s."""
        return max(0.0, 0.5 * (self.most - self.least))


@dataclass(frozen=True)
class LinkReport:
    """Statistics of the packets that one end received.

    Attributes
    ----------
    received : int
        Packets that were read, duplicates included.
    lost : int
        Sequence numbers below the highest that never arrived.
    duplicates, reordered : int
        Packets that arrived again; packets that arrived after a later one.
    late : int
        Packets that arrived too late to be used: overtaken, or refused by the policy.
    foreign, invalid : int
        Datagrams from another address; datagrams that are no packets, or have impossible values.
    round_trip : Percentiles
        Round trips, without the time an answer was held, s.
    held : Percentiles
        Time between the arrival of a packet at the other end and its answer, s.
    lateness : Percentiles
        By how much late packets were older than the newest one in use, or than the policy accepts,
        s.
    jitter : float
        Running mean of the change of the delay to this end from packet to packet (RFC 3550), s.
    forward_delay, return_delay : (float, float)
        Bounds of the mean one-way delay to the other end and from it, s.
    offset, offset_uncertainty : float
        Of the other end's clock against this one, s.
    round_trip_histogram, lateness_histogram : (list of float, list of int)
        Edges in s, and counts.
    """

    received: int
    lost: int
    duplicates: int
    reordered: int
    late: int
    foreign: int
    invalid: int
    round_trip: Percentiles
    held: Percentiles
    lateness: Percentiles
    jitter: float
    forward_delay: tuple[float, float]
    return_delay: tuple[float, float]
    offset: float
    offset_uncertainty: float
    round_trip_histogram: tuple[list[float], list[int]]
    lateness_histogram: tuple[list[float], list[int]]

    @property
    def loss(self) -> float:
        """Share of the sent packets that never arrived."""
        arrived = self.received - self.duplicates
        return self.lost / (self.lost + arrived) if self.lost + arrived else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**asdict(self), "loss": self.loss}


def _newest() -> deque[float]:
    return deque(maxlen=KEPT)


@dataclass
class LinkStatistics:
    """Counts of one stream, and the times of its last 100 000 packets."""

    received: int = 0
    duplicates: int = 0
    reordered: int = 0
    foreign: int = 0
    invalid: int = 0
    round_trips: deque[float] = field(default_factory=_newest)
    held: deque[float] = field(default_factory=_newest)
    lateness: deque[float] = field(default_factory=_newest)
    late: int = 0
    clock: ClockOffset = field(default_factory=ClockOffset)
    _forward: deque[float] = field(default_factory=_newest)
    _return: deque[float] = field(default_factory=_newest)
    _jitter: float = 0.0
    _first: int | None = None
    _highest: int = -1
    _missed: int = 0
    _unique: int = 0
    _may_restart: bool = False

    def __post_init__(self) -> None:
        self._order: deque[int] = deque()
        self._seen: set[int] = set()

    def restart(self) -> None:
        """Accept restarted sequence numbers: the other end may have restarted."""
        self._may_restart = True

    def _restart_count(self) -> None:
        self._missed = self._lost()
        self._first, self._highest, self._unique = None, -1, 0
        self._order.clear()
        self._seen.clear()

    def _lost(self) -> int:
        expected = 0 if self._first is None else self._highest - self._first + 1
        return self._missed + max(0, expected - self._unique)

    def arrived(self, packet: LoopPacket) -> bool:
        """Count a packet; False if it is a duplicate."""
        self.received += 1
        if self._may_restart and packet.sequence <= self._highest:
            self._restart_count()
        self._may_restart = False
        if packet.sequence in self._seen:
            self.duplicates += 1
            return False
        self._remember(packet.sequence)
        if self._first is None:
            self._first = packet.sequence
        self._first = min(self._first, packet.sequence)
        self._unique += 1
        if packet.sequence < self._highest:
            self.reordered += 1
        self._highest = max(self._highest, packet.sequence)
        return True

    def _remember(self, sequence: int) -> None:
        self._order.append(sequence)
        self._seen.add(sequence)
        if len(self._order) > REMEMBERED:
            self._seen.discard(self._order.popleft())

    def exchanged(self, packet: LoopPacket, now: float) -> None:
        """Add the times of a packet that answers one of this end."""
        received_there = packet.sent - packet.held
        forward, returning = received_there - packet.echo_sent, now - packet.sent
        times = packet.echo_sent, received_there, packet.sent, now
        if not self.clock.agrees(*times):  # the other end has restarted, with another clock
            self.clock = ClockOffset()
            self._forward.clear()
            self._return.clear()
        if self._return:
            change = abs(returning - self._return[-1])
            self._jitter += JITTER_PART * (change - self._jitter)
        self._forward.append(forward)
        self._return.append(returning)
        self.held.append(packet.held)
        # Not the sum of both delays, which has the rounding error of a large clock offset.
        self.round_trips.append((now - packet.echo_sent) - packet.held)
        self.clock.add(*times)

    def add_late(self, by: float) -> None:
        """Count a packet that could not be used, with its lateness in s."""
        self.late += 1
        self.lateness.append(by)

    def report(self) -> LinkReport:
        """The statistics until now."""
        nothing = (math.nan, math.nan)
        most, least = self.clock.most, self.clock.least
        forward = float(np.mean(self._forward)) if self._forward else math.nan
        returning = float(np.mean(self._return)) if self._return else math.nan
        return LinkReport(
            received=self.received,
            lost=self._lost(),
            duplicates=self.duplicates,
            reordered=self.reordered,
            late=self.late,
            foreign=self.foreign,
            invalid=self.invalid,
            round_trip=Percentiles.of(self.round_trips),
            held=Percentiles.of(self.held),
            lateness=Percentiles.of(self.lateness),
            jitter=self._jitter,
            # A delay is the difference of the clocks minus the offset, which is between two bounds.
            forward_delay=(forward - most, forward - least) if self._forward else nothing,
            return_delay=(returning + least, returning + most) if self._return else nothing,
            offset=self.clock.offset,
            offset_uncertainty=self.clock.uncertainty if self._forward else math.nan,
            round_trip_histogram=histogram(self.round_trips),
            lateness_histogram=histogram(self.lateness),
        )
