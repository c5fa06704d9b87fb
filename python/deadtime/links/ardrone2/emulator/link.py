"""Sequence numbers, loss of the link, and the one receiver of navdata of an emulated drone.

This link has no authentication. So that it cannot be used to flood other hosts, the emulator
answers a request for navdata only to its sender, with one packet of 24 bytes until a valid command
has been received from the same host. It sends navdata to one address, and stops after two seconds
without activity of its host.
"""

from __future__ import annotations

from deadtime.links.addresses import Address
from deadtime.links.ardrone2.emulator.clock import SECOND, Micros

#: Time without commands after which the drone warns in its navdata (state bit 30).
COM_WATCHDOG: Micros = 50_000

#: Time without commands after which the link is lost (state bit 13) and the drone lands.
LINK_LOST_AFTER: Micros = 2 * SECOND

#: Inactivity of the host after which navdata stop.
LISTENER_LEAVES_AFTER: Micros = 2 * SECOND

#: Shortest time between two answers to requests for navdata.
BETWEEN_ANSWERS: Micros = SECOND // 20

WAKE_UP_SIZES = (1, 2, 4)
UNICAST = 1


class Order:
    """The sequence numbers of commands, and the time since the last one.

    A command is executed if its number is above the last one; number 1 restarts the count, and so
    does any number after the link was lost.

    Examples
    --------
    >>> order = Order()
    >>> [order.accept(number, time=0) for number in (0, 1, 3, 2, 3, 4, 1, 2)]
    [True, True, True, False, False, True, True, True]
    """

    def __init__(self) -> None:
        self._last: int | None = None
        #: Time of the last accepted command; None before the first.
        self.heard: Micros | None = None
        self.lost = False

    def accept(self, number: int, time: Micros) -> bool:
        """Whether a command with this number is to be executed."""
        if number < 0 or (self._last is not None and number != 1 and number <= self._last):
            return False
        self._last, self.heard, self.lost = number, time, False
        return True

    def begins(self, number: int) -> bool:
        """Whether this number is the first one of a client."""
        return number == 0 or (number == 1 and self._last != 0)

    @property
    def loses_at(self) -> Micros | None:
        """Time at which the link is lost without commands; None if there is no link."""
        if self.heard is None or self.lost:
            return None
        return self.heard + LINK_LOST_AFTER

    def lose(self) -> None:
        """Note that the link is lost: the next command may have any number."""
        self._last, self.lost = None, True

    def late(self, time: Micros) -> bool:
        """Whether the communication watchdog warns, because commands are late."""
        return self.heard is None or time - self.heard > COM_WATCHDOG


class Listener:
    """The one address for navdata: that of the last request by the host that sends commands.

    A client is identified by its host. It may use a different socket for each command and for its
    request; every command from its host counts as activity. A second host that requests navdata
    before any command is stored until one of the two sends commands.
    """

    def __init__(self) -> None:
        self.address: Address | None = None
        self._waiting: Address | None = None
        self._commander: str | None = None
        self._heard: Micros = 0
        self._answered: Micros | None = None

    def wake(self, datagram: bytes, source: Address, time: Micros) -> bool:
        """Process a request; True if its sender has become the receiver."""
        if len(datagram) not in WAKE_UP_SIZES or datagram[0] != UNICAST:
            return False
        if self._commander not in (None, source[0]):
            return False
        if not self._is_free_for(self.address, source[0]):
            self._waiting = source
            return False
        before, self.address, self._heard = self.address, source, time
        return before != source

    @staticmethod
    def _is_free_for(address: Address | None, host: str) -> bool:
        """Whether an address is unset or on this host."""
        return address is None or address[0] == host

    def may_answer(self, source: Address, time: Micros) -> bool:
        """Whether a request may be answered now."""
        if source != self.address:
            return False
        if self._answered is not None and time - self._answered < BETWEEN_ANSWERS:
            return False
        self._answered = time
        return True

    def commanded(self, source: Address, time: Micros) -> bool:
        """Note an executed command as activity of its host.

        Returns True if this removes a receiver on another host.
        """
        host = source[0]
        if self._commander is None:
            self._commander = host
            if not self._is_free_for(self.address, host):
                self.address = self._waiting if self._is_free_for(self._waiting, host) else None
                self._waiting, self._heard = None, time
                return True
        if host == self._commander:
            self._heard = time
        return False

    @property
    def leaves_at(self) -> Micros | None:
        """Time at which the receiver is removed if there is no activity."""
        return None if self.address is None else self._heard + LISTENER_LEAVES_AFTER

    def leave(self, time: Micros) -> None:
        """Remove the receiver; a waiting host takes its place."""
        self.address, self._waiting = self._waiting, None
        self._commander, self._heard = None, time

    def commander_left(self) -> None:
        """Note that the link of the commands is lost: any host may command next."""
        self._commander = None
