"""Model of a network: delay, loss, repetition, reordering, limited rate, blackouts.

`Network` describes it; `Network.path` is one direction with its own random numbers. Delays, losses
and repetitions have separate generators, so that another loss does not change the delays of other
packets. A path computes from the arrival of a packet what leaves and when; it has no sockets and no
clock.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from deadtime._base.validation import finite, non_negative, positive, whole_number
from deadtime.links.udp.delays import Constant, Delays


@dataclass(frozen=True)
class Bursts:
    """Bursts of losses (Gilbert 1960, Elliott 1963): a good state and a bad one.

    Parameters
    ----------
    begin, end : float
        Probabilities for each packet of a change from the good state to the bad one, and back.
    good, bad : float
        Probabilities of losing a packet in each state.

    Examples
    --------
    Five packets of a hundred, in bursts of four on average:

    >>> from deadtime.links.udp import Bursts
    >>> round(Bursts(begin=0.013158, end=0.25).mean, 3)
    0.05
    """

    begin: float
    end: float
    good: float = 0.0
    bad: float = 1.0

    def __post_init__(self) -> None:
        for name in ("begin", "end", "good", "bad"):
            _probability(name, getattr(self, name))
        if self.begin > 0.0 and self.end == 0.0:
            raise ValueError(
                "end=0: then a burst of losses would never end. Give a probability above zero"
            )

    @property
    def mean(self) -> float:
        """Long-run share of lost packets."""
        bad = self.begin / (self.begin + self.end) if self.begin else 0.0
        return self.good + bad * (self.bad - self.good)

    @staticmethod
    def of(loss: float, length: float) -> Bursts:
        """Bursts of `length` packets on average that lose this share of all packets."""
        _probability("loss", loss)
        if loss >= 1.0:
            raise ValueError(f"loss={loss}: give a share below 1")
        if not finite("length", length) >= 1.0:
            raise ValueError(f"length={length}: give a mean number of lost packets, at least 1")
        end = 1.0 / length
        begin = end * loss / (1.0 - loss)
        if begin > 1.0:
            raise ValueError(
                f"with bursts of {length:g} packets, the share of lost packets cannot be "
                f"{loss:g}: give longer bursts"
            )
        return Bursts(begin, end)


@dataclass(frozen=True)
class Network:
    """Options of one direction of a network.

    Parameters
    ----------
    delay : Delays or float
        One-way delays; a number is a constant one, s.
    loss : float or Bursts
        Probability that a packet is lost, one by one or in bursts.
    duplication : float
        Probability that a packet arrives a second time, with a delay of its own.
    ordered : bool
        Whether packets stay in order, as in one queue; otherwise they may overtake each other.
    rate : float or None
        Largest rate in bytes a second, one packet after the other.
    queue : float
        Longest wait for the rate, s; a packet that would wait longer is dropped.
    blackouts : tuple of (float, float)
        Intervals in which nothing passes, s after the start of the path.
    reversed_groups : int
        Packets are collected in groups of this size and passed on in reversed order; 1 for none.
    """

    delay: Delays | float = 0.0
    loss: Bursts | float = 0.0
    duplication: float = 0.0
    ordered: bool = False
    rate: float | None = None
    queue: float = 0.5
    blackouts: tuple[tuple[float, float], ...] = ()
    reversed_groups: int = 1

    def __post_init__(self) -> None:
        if isinstance(self.delay, (int, float)):
            non_negative("delay", self.delay)
        if not isinstance(self.loss, Bursts):
            _probability("loss", self.loss)
        _probability("duplication", self.duplication)
        if self.rate is not None:
            positive("rate", self.rate)
        non_negative("queue", self.queue)
        whole_number("reversed_groups", self.reversed_groups, limit=1000)
        for start, stop in self.blackouts:
            if not finite("blackout", start) < finite("blackout", stop):
                raise ValueError(
                    f"the blackout ({start}, {stop}) s has no duration: give a start before its end"
                )

    def path(self, seed: int | str) -> Path:
        """A direction of this network whose random numbers follow from `seed`."""
        return Path(self, seed)


def _probability(name: str, value: float) -> None:
    if not 0.0 <= finite(name, value) <= 1.0:
        raise ValueError(f"{name}={value}: give a probability between 0 and 1")


@dataclass
class Path:
    """One direction of a network during a run.

    Attributes
    ----------
    network : Network
        Its description.
    seed : int or str
        Seed of its random numbers.
    sent, lost, dropped, duplicated : int
        Packets that were sent, lost, dropped because the queue was too long, and duplicated.

    Examples
    --------
    >>> from deadtime.links.udp import Network
    >>> path = Network(delay=0.05).path(seed=1)
    >>> path.send(2.0, b"packet")
    [(2.05, b'packet')]
    """

    network: Network
    seed: int | str
    sent: int = 0
    lost: int = 0
    dropped: int = 0
    duplicated: int = 0
    _bad: bool = False
    _free: float = -math.inf
    _latest: float = -math.inf
    _kept: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        delay = self.network.delay
        self._delay = Constant(float(delay)) if isinstance(delay, (int, float)) else delay
        self._delays = random.Random(f"{self.seed} delays")
        self._losses = random.Random(f"{self.seed} losses")
        self._copies = random.Random(f"{self.seed} copies")

    def send(self, now: float, packet: bytes) -> list[tuple[float, bytes]]:
        """The packets that leave because of this one, and their times, s since the start."""
        self.sent += 1
        lost = self._loses()
        if lost or any(start <= now < stop for start, stop in self.network.blackouts):
            self.lost += 1
            return []
        leaves = self._through_the_queue(now, len(packet))
        if leaves is None:
            self.dropped += 1
            return []
        arrivals = [(self._arrival(leaves), packet)]
        if self._copies.random() < self.network.duplication:
            self.duplicated += 1
            arrivals.append((self._arrival(leaves), packet))
        if self.network.reversed_groups == 1:
            return arrivals
        self._kept += [copy for _, copy in arrivals]
        if len(self._kept) < self.network.reversed_groups:
            return []
        last = max(time for time, _ in arrivals)
        released = [(last, kept) for kept in reversed(self._kept)]
        self._kept = []
        return released

    def counts(self) -> dict[str, int]:
        """Numbers of packets by their fate."""
        names = ("sent", "lost", "dropped", "duplicated")
        return {name: getattr(self, name) for name in names}

    def _loses(self) -> bool:
        loss = self.network.loss
        if not isinstance(loss, Bursts):
            return self._losses.random() < loss
        changes = self._losses.random() < (loss.end if self._bad else loss.begin)
        self._bad ^= changes
        return self._losses.random() < (loss.bad if self._bad else loss.good)

    def _through_the_queue(self, now: float, size: int) -> float | None:
        """Time at which the last byte has left; None if the queue is too long."""
        if self.network.rate is None:
            return now
        begins = max(now, self._free)
        if begins - now > self.network.queue:
            return None
        self._free = begins + size / self.network.rate
        return self._free

    def _arrival(self, leaves: float) -> float:
        arrival = leaves + self._delay.draw(self._delays)
        if self.network.ordered:
            arrival = max(arrival, self._latest)
            self._latest = arrival
        return arrival
