"""Configuration of the drone: set one key after the other, and read the settings back.

The drone acknowledges a CONFIG by setting a bit of its state, COMMAND_MASK, which the client clears
by CTRL 5 before the next. The resulting settings are in the dump on TCP, which CTRL 4 requests.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping

from deadtime._base.errors import LinkError
from deadtime.links.ardrone2.commands import Command, Config, Control
from deadtime.links.ardrone2.configuration import parse_configuration
from deadtime.links.ardrone2.navdata import Navdata

#: Modes of CTRL.
SEND_CONFIGURATION, ACKNOWLEDGE = 4, 5

#: Longest wait for an acknowledgement, s, number of attempts for a key, and time between two CTRL
#: 5, s.
ANSWER, TRIES, AGAIN = 0.5, 5, 0.05

#: Longest wait for the dump, s; number of requests for it; and its largest size, bytes.
DUMP, DUMP_TRIES, LONGEST_DUMP = 2.0, 3, 65536

Send = Callable[[Command], None]
Until = Callable[[Callable[[Navdata], bool], float], Awaitable[bool]]


class Handshake:
    """Configures one drone.

    Parameters
    ----------
    name : str
        The drone, for messages.
    send : callable
        Sends a command, once.
    until : callable
        Waits until a condition on the navdata holds, or for so many seconds; returns whether it
        does.
    """

    def __init__(self, name: str, send: Send, until: Until) -> None:
        self._name, self._send, self._until = name, send, until

    async def set(self, key: str, value: str) -> None:
        """Set one key and wait for the acknowledgement.

        Raises
        ------
        LinkError
            If none comes, or if it cannot be cleared.
        """
        await self._clear()
        for _ in range(TRIES):
            self._send(Config(key, value))
            if await self._until(lambda navdata: navdata.command_acknowledged, ANSWER):
                await self._clear()
                return
        raise LinkError(
            f"{self._name} does not acknowledge {key} = {value}, although this was sent {TRIES} "
            "times: check that no other client is connected"
        )

    async def _clear(self) -> None:
        for _ in range(round(TRIES * ANSWER / AGAIN)):
            if await self._until(lambda navdata: not navdata.command_acknowledged, 0.0):
                return
            self._send(Control(ACKNOWLEDGE))
            if await self._until(lambda navdata: not navdata.command_acknowledged, AGAIN):
                return
        raise LinkError(
            f"CTRL {ACKNOWLEDGE} was sent for {TRIES * ANSWER:g} s, but the acknowledgement bit "
            f"of {self._name} stays set: restart the drone"
        )

    async def read_back(self, host: str, port: int) -> dict[str, str]:
        """The configuration as the drone holds it.

        Raises
        ------
        LinkError
            If it does not arrive.
        """
        problem = ""
        for _ in range(DUMP_TRIES):
            try:
                async with asyncio.timeout(DUMP):
                    return parse_configuration(await self._dump(host, port))
            except asyncio.LimitOverrunError:
                problem = f"its end is missing after {LONGEST_DUMP} bytes"
            except (OSError, EOFError, ValueError) as error:  # among them TimeoutError
                problem = str(error) or f"nothing has been received for {DUMP:g} s"
        raise LinkError(
            f"{self._name} does not send its configuration on TCP port {port} ({problem}). So "
            "the limits of the drone are not known, and it cannot be flown"
        )

    async def _dump(self, host: str, port: int) -> bytes:
        reader, writer = await asyncio.open_connection(host, port, limit=LONGEST_DUMP)
        try:
            self._send(Control(SEND_CONFIGURATION))
            return await reader.readuntil(b"\0")
        finally:
            writer.close()


def check_configuration(name: str, held: Mapping[str, str], requested: Mapping[str, str]) -> None:
    """Refuse a drone that does not keep a setting.

    Raises
    ------
    LinkError
        With the key, and its value.
    """
    for key, value in requested.items():
        found = held.get(key)
        if found is None or not _same(found, value):
            shown = "nothing" if found is None else found
            raise LinkError(
                f"{name}: {key} was set to {value}, but the drone reports {shown}. A drone that "
                "does not keep its limits cannot be flown"
            )


def _same(found: str, requested: str) -> bool:
    """Whether two values are the same number, or the same text."""
    try:
        return abs(float(found) - float(requested)) <= 1e-6 * abs(float(requested))
    except ValueError:
        return found.strip().upper() == requested.strip().upper()
