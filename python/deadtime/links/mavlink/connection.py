"""Messages of one vehicle: heartbeats, TIMESYNC, requests and their answers, over its links."""

from __future__ import annotations

import asyncio
import math
import warnings
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from deadtime._base.errors import LinkError
from deadtime._base.printable import printable
from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.belief import SURE
from deadtime.links.mavlink.carrier import Carrier
from deadtime.links.mavlink.carriers import Carriers
from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.links.mavlink.senders import Senders
from deadtime.links.mavlink.states import NUMBERS
from deadtime.links.mavlink.time_sync import EVERY, LinkTime

T = TypeVar("T")

#: Time between two heartbeats, s: a vehicle that lands without them for 2 s may miss three.
HEARTBEAT = 0.5

#: Time between two looks for silent links, s.
LOOK = 0.05

#: Time for an answer before a request is repeated, s, and number of requests.
ANSWER, TRIES = 0.7, 8

#: Of two heartbeats that come within this time, s, the one that was sent later counts: a link that
#: scatters delivers them in another order, and the mode would seem to go back.
REORDERED = 0.2

#: Texts of the vehicle that are kept, and severity up to which: 4 is a warning.
TEXTS, WARNING = 8, 4


class Connection:
    """Messages to and from one vehicle, over one link or several.

    Parameters
    ----------
    addresses : sequence of LinkAddress
        The first is preferred at first; the others stand by.
    system, component : int
        Ids of this end.
    vehicle : int, optional
        System id of the vehicle; the first autopilot that sends, if not given.
    key : bytes, optional
        Signing key.

    Attributes
    ----------
    carriers : Carriers
        The links.
    senders : Senders
        Who has sent.
    latest : dict
        The newest message of the vehicle by its name, with the time of its arrival.
    texts : list
        Newest warnings of the vehicle: time and text.
    failure : Exception or None
        An error of what is called with each message.
    take, switched : callable
        Called with each message and the time of its arrival, and when another link is used.
    """

    def __init__(
        self,
        addresses: Sequence[LinkAddress],
        system: int,
        component: int,
        vehicle: int | None = None,
        key: bytes | None = None,
    ) -> None:
        self.address = ",".join(map(str, addresses))
        self.senders = Senders((system, component), vehicle)
        self.latest: dict[str, tuple[float, Any]] = {}
        self.texts: list[tuple[float, str]] = []
        self.failure: Exception | None = None
        self.take: Callable[[Any, float], None] = lambda message, time: None
        self.switched: Callable[[], None] = lambda: None
        links = [
            Carrier(address, Codec(system, component, key, number), self.senders, self._receive)
            for number, address in enumerate(addresses)
        ]
        self.carriers = Carriers(links, _warn, lambda: self.switched())
        self._waiting: list[tuple[Callable[[Any], bool], asyncio.Future[Any]]] = []
        self._tasks: list[asyncio.Task[None]] = []
        self._heartbeats: dict[tuple[Carrier, int, int], tuple[float, int]] = {}

    @property
    def is_open(self) -> bool:
        """Whether it is open."""
        return bool(self._tasks)

    @property
    def silent(self) -> float:
        """Time since the last message of the vehicle, s; 0 before the first."""
        current = self.carriers.current
        return 0.0 if current.heard is None else current.silent

    @property
    def link_time(self) -> LinkTime | None:
        """Round trip and clock offset of the link in use; None before the first answer."""
        return self.carriers.current.time_sync.link_time

    @property
    def target(self) -> tuple[int, int]:
        """System and component of the vehicle; 0 for all while it is unknown."""
        return self.senders.vehicle or 0, 1

    async def open(self) -> None:
        """Open the links, and send heartbeats from now on.

        Raises
        ------
        LinkError
            If one cannot be opened.
        """
        try:
            for carrier in self.carriers:
                await carrier.open()
        except BaseException:
            self.shut()
            raise
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(self._every(HEARTBEAT, Carrier.send_heartbeat)),
            loop.create_task(self._every(EVERY, Carrier.send_time_sync)),
        ]
        if len(list(self.carriers)) > 1:
            self._tasks.append(loop.create_task(self._look()))

    def shut(self) -> None:
        """Close it."""
        for task in self._tasks:
            task.cancel()
        self._tasks = []
        for carrier in self.carriers:
            carrier.close()

    async def _every(self, period: float, send: Callable[[Carrier], None]) -> None:
        while True:
            for carrier in self.carriers:
                send(carrier)
            await asyncio.sleep(period)

    async def _look(self) -> None:
        while True:
            try:
                self.carriers.look()
            except Exception as error:  # a warning that is an error; the vehicle raises it later
                self.failure = self.failure or error
            await asyncio.sleep(LOOK)

    def send(self, message: Any) -> None:
        """Send a message at once, over the link in use."""
        self.carriers.current.send(message)

    def _receive(self, carrier: Carrier, message: Any, time: float) -> None:
        if carrier is self.carriers.current and not self._is_overtaken(carrier, message, time):
            self._accept(message, time)

    def _is_overtaken(self, carrier: Carrier, message: Any, time: float) -> bool:
        """Whether this is a heartbeat that comes after one that was sent later."""
        if message.get_type() != "HEARTBEAT":
            return False
        sender = carrier, message.get_srcSystem(), message.get_srcComponent()
        seen, newest = self._heartbeats.get(sender, (-math.inf, 0))
        number = message.get_seq()
        if time - seen < REORDERED and 0 < (newest - number) % NUMBERS < NUMBERS // 2:
            return True
        self._heartbeats[sender] = time, number
        return False

    def _accept(self, message: Any, time: float) -> None:
        kind = message.get_type()
        self.latest[kind] = time, message
        if kind == "STATUSTEXT" and message.severity <= WARNING:
            self.texts = [*self.texts[1 - TEXTS :], (time, printable(str(message.text)))]
        try:
            self.take(message, time)
        except Exception as error:  # nobody could catch it here: the vehicle raises it later
            self.failure = self.failure or error
        for holds, future in self._waiting:
            if not future.done() and holds(message):
                future.set_result(message)

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

    async def agreed(
        self, request: Callable[[], Any], value_of: Callable[[Any], T | None], tries: int = TRIES
    ) -> T | None:
        """Ask until `SURE` answers in a row have the same value; None if they do not.

        Parameters
        ----------
        request : callable
            Makes a request.
        value_of : callable
            The value in a message, or None if it is no answer.
        tries : int
            Number of times that missing answers are asked for.
        """
        answers: list[T] = []

        def agree(message: Any) -> bool:
            value = value_of(message)
            if value is None:
                return False
            if answers and answers[-1] != value:
                answers.clear()
            answers.append(value)
            return len(answers) >= SURE

        for _ in range(tries):
            for _ in range(SURE):
                self.send(request())
            if await self.next(agree, ANSWER) is not None:
                return answers[-1]
        return None

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

    async def board(self) -> str:
        """The number of the vehicle's board; empty where it does not say one."""
        d = dialect()
        values = [float(d.MAVLINK_MSG_ID_AUTOPILOT_VERSION), *[0.0] * 6]

        def request() -> Any:
            return d.MAVLink_command_long_message(
                *self.target, d.MAV_CMD_REQUEST_MESSAGE, 0, *values
            )

        def number(message: Any) -> str | None:
            if message.get_type() != "AUTOPILOT_VERSION":
                return None
            return bytes(message.uid2).hex() if any(message.uid2) else f"{message.uid:x}"

        found = await self.agreed(request, number, tries=2)
        return "" if found in (None, "0") else found

    def said(self, since: float) -> str:
        """The newest warnings of the vehicle after a time, as a clause, or nothing."""
        texts = list(dict.fromkeys(text for time, text in self.texts if time >= since))
        if not texts:
            return ""
        return '. The vehicle says "' + '", "'.join(texts[-3:]) + '"'


def _warn(what: str) -> None:
    warnings.warn(what, RuntimeWarning, stacklevel=2)
