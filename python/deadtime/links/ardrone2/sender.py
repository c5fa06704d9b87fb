"""The datagrams to the drone: a request to fly or to land, and a motion that expires.

The drone expects a datagram every 30 ms. A motion that is older than `Limits.command_age` becomes
hovering; without a new one for `Limits.landing_after` the drone lands.

All of it happens in the event loop of the controller. If that was paused, the drone may have landed
meanwhile, and repeating the request to fly would make it take off. Therefore the request is not
repeated: after a pause longer than `Limits.command_age`, datagrams command hovering and neither
flying nor landing, until navdata that were sent after the pause show that the drone flies. After a
pause longer than the watchdog of the drone they command landing; so they do when the drone reports
that it is down, lands by itself, or obeys another client. Only `CommandSender.fly` requests to fly.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from deadtime.links.ardrone2.commands import Command, Hover, Move, Ref, Watchdog, encode
from deadtime.links.ardrone2.navdata import Navdata
from deadtime.links.ardrone2.reader import on_ground, unasked_end
from deadtime.links.expiry import ExpiringCommand
from deadtime.links.safety import Limits, UnitCommand

#: Time between two datagrams, s.
CYCLE = 0.03

#: Time without a command after which the drone lands by itself, s.
WATCHDOG = 2.0

#: Kept numbers of REF, to recognise them in navdata: those of the last half minute.
KEPT = 1024


class CommandSender(ExpiringCommand):
    """Makes the datagrams.

    Parameters
    ----------
    limits : Limits
        Limits of the age of a command.

    Attributes
    ----------
    in_air : bool
        Whether the drone is commanded to be in the air.
    cut : bool
        Whether the next datagram toggles between emergency and normal.
    rival : str or None
        How another client was detected.
    resumed : float
        First datagram after the last pause, s; minus infinity before any pause.
    """

    def __init__(self, limits: Limits) -> None:
        super().__init__(limits, Hover)
        self.in_air = False
        self.cut = False
        self.rival: str | None = None
        self.resumed = -math.inf
        self._next = 1
        self._sent: float | None = None
        self._uncertain = False
        self._left_ground = False
        self._refs: deque[int] = deque(maxlen=KEPT)
        self._echo = 0

    def fly(self) -> None:
        """Command take-off, then hovering."""
        self.in_air, self.guarded, self.expired, self._motion = True, False, None, Hover
        self._uncertain = self._left_ground = False

    def guard(self, now: float) -> None:
        """Let commands expire from now on, if the drone is still commanded to fly."""
        self.guarded, self._given = self.in_air, now

    def land(self) -> None:
        """Command landing."""
        self.in_air, self.guarded, self._motion, self._uncertain = False, False, Hover, False

    def give_up(self, reason: str) -> None:
        """Command landing without `land`; the first reason is kept."""
        if self.in_air:
            self.land()
            self.expired = reason

    def climb(self, share: UnitCommand, now: float) -> UnitCommand:
        """Command a share of the largest vertical speed; return what is sent, 0 while uncertain."""
        self.age(now)
        move = Move(gaz=share) if self.guarded and not self._uncertain else Hover
        self.command(move, now)
        return move.gaz

    def datagram(self, now: float, alive: bool = False, more: Sequence[Command] = ()) -> bytes:
        """The next datagram.

        Parameters
        ----------
        now : float
            s.
        alive : bool
            Whether to reset the drone's watchdog.
        more : sequence of Command
            Further commands for this datagram.
        """
        self.age(now)
        self._sent = now
        commands: list[Command] = []
        if not self._uncertain:
            commands.append(Ref(take_off=self.in_air, emergency=self.cut))
            self._refs.appendleft(self._next)
            self.cut = False
        if alive:
            commands.append(Watchdog())
        commands.append(self._motion)
        commands.extend(more)
        first, self._next = self._next, self._next + len(commands)
        return encode(commands, first)

    def age(self, now: float) -> None:
        """Let commands expire that are too old."""
        self._notice_pause(now)
        if not self.in_air:
            return
        most = self.limits.landing_after
        if self._uncertain and now - self.resumed > most:
            self.give_up(
                "since a pause of this program, no message from the vehicle has arrived for "
                f"{most:g} s. The vehicle was commanded to land"
            )
        super().age(now)

    def _notice_pause(self, now: float) -> None:
        """Do not repeat a request from before a pause in which the vehicle may have landed."""
        pause = 0.0 if self._sent is None else now - self._sent
        if pause <= min(max(self.limits.command_age, 3.0 * CYCLE), WATCHDOG):
            return
        self.resumed = self._sent = now
        self._motion = Hover
        if pause > WATCHDOG:
            self.give_up(
                f"this program was paused for {pause:.2f} s. In such a pause the vehicle lands "
                f"by itself after {WATCHDOG:g} s. The vehicle was commanded to land"
            )
        else:
            self._uncertain = self.in_air

    def received(self, navdata: Navdata, sent: float | None) -> None:
        """Compare the request to fly with what the drone reports.

        Parameters
        ----------
        navdata : Navdata
            The newest.
        sent : float or None
            When they were sent, s; None if that is not known.
        """
        self._look_for_others(navdata)
        self._left_ground = self._left_ground or not on_ground(navdata)
        ended = self.rival or unasked_end(navdata, self._left_ground)
        if ended is not None:
            self.give_up(ended)
        # The drone warns after 50 ms without a command; without this warning in navdata from after
        # the pause, it has received commands after the pause.
        elif sent is not None and sent > self.resumed and not navdata.com_watchdog:
            self._uncertain = False

    def _look_for_others(self, navdata: Navdata) -> None:
        """Compare the number of the last REF that the drone executed with those sent here.

        For one client it never goes back; before the first one of this client it has no meaning.
        """
        if navdata.bootstrap:  # it has dropped all clients
            self._echo = 0
        if navdata.video_stream is None:
            return
        number = navdata.video_stream.atcmd_ref_seq
        if number >= self._echo and number in self._refs:
            self._echo = number
        elif self._echo:
            self.rival = (
                "another client commands this drone, because the drone has executed REF number "
                f"{number}, which this program did not send. End the other client, and connect "
                "again"
            )
