"""A link to one vehicle: frames in and out, heartbeats, TIMESYNC, requests and their answers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.clock import now
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.links.mavlink.senders import Senders
from deadtime.links.mavlink.sockets import LinkSocket
from deadtime.links.mavlink.time_sync import EVERY, TimeSync

#: Time between two heartbeats, s: a vehicle that lands without them for 2 s may miss three.
HEARTBEAT = 0.5

#: Time for an answer before a request is repeated, s, and number of requests.
ANSWER, TRIES = 0.7, 6

#: Texts of the vehicle that are kept, and severity up to which: 4 is a warning.
TEXTS, WARNING = 8, 4


class Connection:
    """Messages to and from one vehicle.

    Parameters
    ----------
    address : LinkAddress
    system, component : int
        Ids of this end.
    vehicle : int, optional
        System id of the vehicle; the first autopilot that sends, if not given.
    key : bytes, optional
        Signing key.

    Attributes
    ----------
    senders : Senders
        Who has sent.
    latest : dict
        The newest message of the vehicle by its name, with the time of its arrival.
    texts : list
        Newest warnings of the vehicle: time and text.
    failure : Exception or None
        An error of what is called with each message.
    """

    def __init__(
        self,
        address: LinkAddress,
        system: int,
        component: int,
        vehicle: int | None = None,
        key: bytes | None = None,
    ) -> None:
        self.address = address
        self.codec = Codec(system, component, key)
        self.senders = Senders((system, component), vehicle)
        self.time_sync = TimeSync()
        self.latest: dict[str, tuple[float, Any]] = {}
        self.texts: list[tuple[float, str]] = []
        self.failure: Exception | None = None
        self.take: Callable[[Any, float], None] = lambda message, time: None
        self._socket = LinkSocket(self._receive)
        self._heard: float | None = None
        self._waiting: list[tuple[Callable[[Any], bool], asyncio.Future[Any]]] = []
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def is_open(self) -> bool:
        """Whether it is open."""
        return bool(self._tasks)

    @property
    def silent(self) -> float:
        """Time since the last message of the vehicle, s; 0 before the first."""
        return 0.0 if self._heard is None else now() - self._heard

    @property
    def target(self) -> tuple[int, int]:
        """System and component of the vehicle; 0 for all while it is unknown."""
        return self.senders.vehicle or 0, 1

    async def open(self) -> None:
        """Open the socket, and send heartbeats from now on.

        Raises
        ------
        LinkError
            If it cannot be opened.
        """
        await self._socket.open(self.address)
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(self._every(HEARTBEAT, self._send_heartbeat)),
            loop.create_task(self._every(EVERY, self._send_time_sync)),
        ]

    def shut(self) -> None:
        """Close it."""
        for task in self._tasks:
            task.cancel()
        self._tasks = []
        self._socket.close()

    async def _every(self, period: float, send: Callable[[], None]) -> None:
        while True:
            send()
            await asyncio.sleep(period)

    def _send_heartbeat(self) -> None:
        d = dialect()
        self.send(
            d.MAVLink_heartbeat_message(
                d.MAV_TYPE_GCS, d.MAV_AUTOPILOT_INVALID, 0, 0, d.MAV_STATE_ACTIVE, 3
            )
        )

    def _send_time_sync(self) -> None:
        if self.senders.vehicle is not None:
            stamp = self.time_sync.request(now())
            self.send(dialect().MAVLink_timesync_message(0, stamp))

    def send(self, message: Any) -> None:
        """Send a message at once."""
        self._socket.send(self.codec.encode(message))

    def _receive(self, data: bytes, sender: Any, whole: bool) -> None:
        time = now()
        known = self._socket.peer
        if known is not None and sender != known:
            self.senders.elsewhere += 1
            return
        for message in self.codec.decode(data, whole):
            if not self.senders.is_vehicle(message):
                continue
            if known is None and sender is not None:
                known = sender
                self._socket.answer(sender)
                self._send_heartbeat()
            self._heard = time
            self._accept(message, time)

    def _accept(self, message: Any, time: float) -> None:
        kind = message.get_type()
        self.latest[kind] = time, message
        if kind == "TIMESYNC":
            self._take_time_sync(message, time)
        elif kind == "STATUSTEXT" and message.severity <= WARNING:
            self.texts = [*self.texts[1 - TEXTS :], (time, str(message.text))]
        try:
            self.take(message, time)
        except Exception as error:  # nobody could catch it here: the vehicle raises it later
            self.failure = self.failure or error
        for holds, future in self._waiting:
            if not future.done() and holds(message):
                future.set_result(message)

    def _take_time_sync(self, message: Any, time: float) -> None:
        if message.tc1 == 0:
            self.send(dialect().MAVLink_timesync_message(round(time * 1e9), message.ts1))
        else:
            self.time_sync.answered(message.ts1, message.tc1, time)

    async def next(self, holds: Callable[[Any], bool], timeout: float) -> Any:
        """The next message of which something holds, or None after the timeout, s."""
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        entry = (holds, future)
        self._waiting.append(entry)
        try:
            async with asyncio.timeout(timeout):
                return await future
        except TimeoutError:
            return None
        finally:
            self._waiting.remove(entry)

    async def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until a condition holds after a message; False after the timeout, s."""
        return condition() or await self.next(lambda message: condition(), timeout) is not None

    async def ask(
        self, message: Callable[[int], Any], holds: Callable[[Any], bool], what: str
    ) -> Any:
        """Send a request, made anew for each try from its number, until it is answered.

        Raises
        ------
        LinkError
            If it is not.
        """
        for attempt in range(TRIES):
            self.send(message(attempt))
            answer = await self.next(holds, ANSWER)
            if answer is not None:
                return answer
        raise LinkError(f"{self.address}: the vehicle does not {what}")

    async def command(self, number: int, *values: float) -> int:
        """Send a command until it is acknowledged; return the MAV_RESULT.

        Raises
        ------
        LinkError
            If it is not acknowledged.
        """
        d = dialect()
        given = [*values, *[0.0] * (7 - len(values))]

        def message(attempt: int) -> Any:
            return d.MAVLink_command_long_message(*self.target, number, attempt, *given)

        def answers(reply: Any) -> bool:
            return bool(
                reply.get_type() == "COMMAND_ACK"
                and reply.command == number
                and reply.result != d.MAV_RESULT_IN_PROGRESS
                # 0: an autopilot that does not say whom it answers
                and reply.target_system in (0, self.senders.own[0])
            )

        name = d.enums["MAV_CMD"][number].name
        reply = await self.ask(message, answers, f"acknowledge {name}")
        return int(reply.result)

    def said(self, since: float) -> str:
        """The newest warnings of the vehicle after a time, as a clause, or nothing."""
        texts = list(dict.fromkeys(text for time, text in self.texts if time >= since))
        if not texts:
            return ""
        return '; the vehicle says "' + '", "'.join(texts[-3:]) + '"'
