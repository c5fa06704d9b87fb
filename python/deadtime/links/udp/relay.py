"""A relay that emulates the network between plant and controller.

It listens for the plant and sends to the controller from a port of its own. Packets are delayed,
lost, repeated and reordered by a `Path` in each direction; their contents are not read.
"""

from __future__ import annotations

import asyncio
import heapq
import itertools
from contextlib import ExitStack
from dataclasses import dataclass, field

from deadtime.links.addresses import Address
from deadtime.links.udp.endpoint import Socket, open_socket, resolved, speaking_to
from deadtime.links.udp.network import Network, Path

#: Most packets in transit; further ones are dropped (bounds memory).
MOST_IN_TRANSIT = 10_000

#: Silence of the plant after which another one is accepted, s.
IDLE = 2.0


@dataclass(frozen=True)
class RelayOptions:
    """Options of a relay.

    Parameters
    ----------
    controller : (str, int)
        Address of the controller.
    forward_path, return_path : Network
        Network from the plant to the controller, and back.
    seed : int
        Seed of all delays and losses.
    listen : (str, int)
        Address for the plant; port 0 takes a free one.
    """

    controller: Address
    forward_path: Network = field(default_factory=Network)
    return_path: Network = field(default_factory=Network)
    seed: int = 0
    listen: Address = ("127.0.0.1", 0)


class Relay:
    """A running relay: ``async with Relay(options) as relay``, then send to ``relay.address``.

    Attributes
    ----------
    forward_path, return_path : Path
        The two directions, with counts of their packets.
    overflowed : int
        Packets that were dropped because 10 000 were in transit.
    """

    def __init__(self, options: RelayOptions) -> None:
        self.options = options
        self.forward_path: Path = options.forward_path.path(f"{options.seed} there")
        self.return_path: Path = options.return_path.path(f"{options.seed} back")
        self.overflowed = 0
        self._in_transit: list[tuple[float, int, bytes, bool]] = []
        self._number = itertools.count()
        self._timer: asyncio.TimerHandle | None = None
        self._plant: Address | None = None
        self._heard = 0.0

    async def __aenter__(self) -> Relay:
        self._loop = asyncio.get_running_loop()
        self._started = self._loop.time()
        self._controller = await resolved(self.options.controller)
        self._front: Socket = await open_socket(self._from_plant, self.options.listen)
        with ExitStack() as stack:
            stack.callback(self._front.close)
            own = speaking_to(self._controller)
            self._rear: Socket = await open_socket(self._from_controller, own)
            stack.pop_all()
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._front.close()
        self._rear.close()

    @property
    def address(self) -> Address:
        """Where the relay listens for the plant."""
        return self._front.address

    def _from_plant(self, data: bytes, address: Address) -> None:
        now = self._loop.time()
        if address != self._plant:
            if self._plant is not None and now - self._heard < IDLE:
                return
            self._plant = address
        self._heard = now
        self._pass_on(self.forward_path, now, data, True)

    def _from_controller(self, data: bytes, address: Address) -> None:
        if address == self._controller:
            self._pass_on(self.return_path, self._loop.time(), data, False)

    def _pass_on(self, path: Path, now: float, data: bytes, forward: bool) -> None:
        for arrival, packet in path.send(now - self._started, data):
            if len(self._in_transit) >= MOST_IN_TRANSIT:
                self.overflowed += 1
                continue
            entry = (self._started + arrival, next(self._number), packet, forward)
            heapq.heappush(self._in_transit, entry)
        self._wait()

    def _wait(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._in_transit:
            self._timer = self._loop.call_at(self._in_transit[0][0], self._deliver)

    def _deliver(self) -> None:
        due = max(self._loop.time(), self._in_transit[0][0])  # a timer may fire early by rounding
        while self._in_transit and self._in_transit[0][0] <= due:
            _, _, packet, forward = heapq.heappop(self._in_transit)
            if forward:
                self._rear.send(packet, self._controller)
            elif self._plant is not None:
                self._front.send(packet, self._plant)
        self._timer = None
        self._wait()
