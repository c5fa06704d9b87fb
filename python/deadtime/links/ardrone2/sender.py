"""What is sent to the drone, cycle by cycle: a wish to fly or to land, and a motion that ages.

The drone wants to hear something every 30 ms. A motion that is older than `Limits.command_age`
becomes hovering; when none has come for `Limits.landing_after`, landing.

All of it happens in the event loop of the controller. When that has stood still, the drone may have
landed meanwhile, and to repeat the wish of before would ask it to take off. So nothing repeats that
wish: after a pause longer than `Limits.command_age` datagrams say to hover, and nothing of flying
or landing, until navdata that were sent after the pause tell that the drone flies. After one longer
than the drone's own watchdog they say to land, and also when the drone says that it is down, lands
by itself, or obeys another client. Only `CommandSender.fly` asks to fly.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from deadtime.links.ardrone2.commands import Command, Hover, Move, Ref, Watchdog, encode
from deadtime.links.ardrone2.navdata import Navdata
from deadtime.links.ardrone2.reader import on_ground, unasked_end
from deadtime.links.safety import Limits, UnitCommand

__all__ = ["CYCLE", "CommandSender"]

#: Time between two datagrams, s.
CYCLE = 0.03

#: Without a command for so long the drone lands by itself, s.
WATCHDOG = 2.0

#: Numbers of REF that are kept, to be recognised in navdata: those of the last half minute.
KEPT = 1024


class CommandSender:
    """Makes the datagrams.

    Parameters
    ----------
    limits : Limits
        The ages of a command.

    Attributes
    ----------
    in_air : bool
        Whether the drone is asked to be in the air.
    guarded : bool
        Whether a command that does not come lands the drone: in flight, not while taking off.
    cut : bool
        Whether the next datagram asks to toggle between emergency and normal.
    expired : str or None
        Why the drone was asked to land without anybody having said so.
    rival : str or None
        How another client was noticed.
    resumed : float
        When datagrams went out again after the last pause, s; minus infinity before any.
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.in_air = False
        self.guarded = False
        self.cut = False
        self.expired: str | None = None
        self.rival: str | None = None
        self.resumed = -math.inf
        self._move: Move = Hover
        self._given = 0.0
        self._next = 1
        self._sent: float | None = None
        self._in_doubt = False
        self._left_ground = False
        self._refs: deque[int] = deque(maxlen=KEPT)
        self._echo = 0

    def fly(self) -> None:
        """Ask for taking off, hovering."""
        self.in_air, self.guarded, self.expired, self._move = True, False, None, Hover
        self._in_doubt = self._left_ground = False

    def guard(self, now: float) -> None:
        """From now on commands grow old, if the wish to fly still stands."""
        self.guarded, self._given = self.in_air, now

    def land(self) -> None:
        """Ask for landing."""
        self.in_air, self.guarded, self._move, self._in_doubt = False, False, Hover, False

    def give_up(self, reason: str) -> None:
        """Ask for landing although nobody has said so; the first reason is kept."""
        if self.in_air:
            self.land()
            self.expired = reason

    def climb(self, share: UnitCommand, now: float) -> UnitCommand:
        """Ask for a share of the largest vertical speed; tell what is sent, 0 while in doubt."""
        self.age(now)
        self._given = now
        moves = self.guarded and not self._in_doubt
        self._move = Move(gaz=share) if moves else Hover
        return self._move.gaz

    def hover(self, now: float) -> None:
        """Ask for no motion."""
        self.age(now)
        self._move, self._given = Hover, now

    def datagram(self, now: float, alive: bool = False, more: Sequence[Command] = ()) -> bytes:
        """The next datagram.

        Parameters
        ----------
        now : float
            s.
        alive : bool
            Whether to reset the drone's watchdog.
        more : sequence of Command
            What else to say, once.
        """
        self.age(now)
        self._sent = now
        commands: list[Command] = []
        if not self._in_doubt:
            commands.append(Ref(take_off=self.in_air, emergency=self.cut))
            self._refs.appendleft(self._next)
            self.cut = False
        if alive:
            commands.append(Watchdog())
        commands.append(self._move)
        commands.extend(more)
        first, self._next = self._next, self._next + len(commands)
        return encode(commands, first)

    def age(self, now: float) -> None:
        """Let what is too old by now lapse."""
        self._notice_pause(now)
        if not self.in_air:
            return
        most = self.limits.landing_after
        if self._in_doubt and now - self.resumed > most:
            self.give_up(
                f"nothing that the vehicle sent after a pause of this program has come for {most:g}"
                " s: the vehicle was told to land"
            )
        age = now - self._given
        if self.guarded and age > self.limits.command_age:
            self._move = Hover
        if self.guarded and age > most:
            self.give_up(f"no command for {age:.2f} s: the vehicle was told to land")

    def _notice_pause(self, now: float) -> None:
        """Repeat no wish of before a pause in which the vehicle may have landed."""
        pause = 0.0 if self._sent is None else now - self._sent
        if pause <= min(max(self.limits.command_age, 3.0 * CYCLE), WATCHDOG):
            return
        self.resumed = self._sent = now
        self._move = Hover
        if pause > WATCHDOG:
            self.give_up(
                f"this program stood still for {pause:.2f} s, in which the vehicle's own watchdog "
                f"lands it ({WATCHDOG:g} s): the vehicle was told to land"
            )
        else:
            self._in_doubt = self.in_air

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
        # The drone warns when it has heard nothing for 50 ms; if it does not, and said so after the
        # pause, it has heard what came after the pause.
        elif sent is not None and sent > self.resumed and not navdata.com_watchdog:
            self._in_doubt = False

    def _look_for_others(self, navdata: Navdata) -> None:
        """Compare the number of the last REF that the drone carried out with those sent here.

        Of one client it never goes back; what it is before the first of this one says nothing.
        """
        if navdata.bootstrap:  # it has forgotten everybody
            self._echo = 0
        if navdata.video_stream is None:
            return
        number = navdata.video_stream.atcmd_ref_seq
        if number >= self._echo and number in self._refs:
            self._echo = number
        elif self._echo:
            self.rival = (
                f"another client commands this drone: it has carried out REF number {number}, which"
                " was not sent from here. End the other client, and connect again"
            )
