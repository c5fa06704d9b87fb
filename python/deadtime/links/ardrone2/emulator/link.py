"""Who the drone listens to and whom it answers: sequence numbers, silence, and its one listener.

Nothing authenticates anybody on this link. What an emulator can do against being used to flood
others: answer a wake-up to its sender only, and by no more than one packet of 24 bytes until a
valid command has come from the same host; send navdata to one address; and stop after two seconds
without a sign of life from its host.
"""

from __future__ import annotations

from typing import TypeAlias

from deadtime.links.ardrone2.emulator.clock import SECOND, Micros

__all__ = ["LINK_LOST_AFTER", "Address", "Listener", "Order"]

Address: TypeAlias = tuple[str, int]

#: Without commands for so long the drone warns of it in its navdata (state bit 30).
COM_WATCHDOG: Micros = 50_000

#: Without commands for so long the link is lost (state bit 13): the drone lands.
LINK_LOST_AFTER: Micros = 2 * SECOND

#: Without a sign of life for so long navdata stop.
LISTENER_LEAVES_AFTER: Micros = 2 * SECOND

#: Wake-ups are answered no more often than this.
BETWEEN_ANSWERS: Micros = SECOND // 20

WAKE_UP_SIZES = (1, 2, 4)
UNICAST = 1


class Order:
    """The sequence numbers of commands, and the silence between them.

    A command is executed if its number is above the last; number 1 begins anew, and so does any
    number after the link was lost.

    Examples
    --------
    >>> order = Order()
    >>> [order.accept(number, time=0) for number in (0, 1, 3, 2, 3, 4, 1, 2)]
    [True, True, True, False, False, True, True, True]
    """

    def __init__(self) -> None:
        self._last: int | None = None
        #: When the last command was accepted; None before the first.
        self.heard: Micros | None = None
        self.lost = False

    def accept(self, number: int, time: Micros) -> bool:
        """Whether a command with this number is to be executed."""
        if number < 0 or (self._last is not None and number != 1 and number <= self._last):
            return False
        self._last, self.heard, self.lost = number, time, False
        return True

    def begins(self, number: int) -> bool:
        """Whether this number, if it comes next, is a client's first."""
        return number == 0 or (number == 1 and self._last != 0)

    @property
    def loses_at(self) -> Micros | None:
        """When the link is lost if nothing comes; None if it is lost already or was never there."""
        if self.heard is None or self.lost:
            return None
        return self.heard + LINK_LOST_AFTER

    def lose(self) -> None:
        """The link is lost: the next command may have any number."""
        self._last, self.lost = None, True

    def late(self, time: Micros) -> bool:
        """Whether the communication watchdog warns."""
        return self.heard is None or time - self.heard > COM_WATCHDOG


class Listener:
    """The one address that navdata go to: where the host of the commands has asked for them last.

    A client is known by its host. It may have a socket for each command, and ask again from
    another one; any command from its host is a sign of its life. Another host that asks while
    nobody commands is kept in mind until it is clear which one does.
    """

    def __init__(self) -> None:
        self.address: Address | None = None
        self._waiting: Address | None = None
        self._commander: str | None = None
        self._heard: Micros = 0
        self._answered: Micros | None = None

    def wake(self, datagram: bytes, source: Address, time: Micros) -> bool:
        """Take a wake-up; True if its sender has become the listener."""
        if len(datagram) not in WAKE_UP_SIZES or datagram[0] != UNICAST:
            return False
        if self._commander not in (None, source[0]):
            return False
        if not self._is_here(self.address, source[0]):
            self._waiting = source
            return False
        before, self.address, self._heard = self.address, source, time
        return before != source

    @staticmethod
    def _is_here(address: Address | None, host: str) -> bool:
        """Whether nobody but this host has the address."""
        return address is None or address[0] == host

    def may_answer(self, source: Address, time: Micros) -> bool:
        """Whether a packet may go out in answer to a wake-up, now."""
        if source != self.address:
            return False
        if self._answered is not None and time - self._answered < BETWEEN_ANSWERS:
            return False
        self._answered = time
        return True

    def commanded(self, source: Address, time: Micros) -> bool:
        """A command was executed: a sign of life of the host that commands.

        A listener on another host leaves: True, if so.
        """
        host = source[0]
        if self._commander is None:
            self._commander = host
            if not self._is_here(self.address, host):
                self.address = self._waiting if self._is_here(self._waiting, host) else None
                self._waiting, self._heard = None, time
                return True
        if host == self._commander:
            self._heard = time
        return False

    @property
    def leaves_at(self) -> Micros | None:
        """When the listener is taken to have left, if nothing comes."""
        return None if self.address is None else self._heard + LISTENER_LEAVES_AFTER

    def leave(self, time: Micros) -> None:
        """The listener has left; who has waited takes its place."""
        self.address, self._waiting = self._waiting, None
        self._commander, self._heard = None, time

    def commander_left(self) -> None:
        """The link of the commands is lost: anybody may be the next to command."""
        self._commander = None
