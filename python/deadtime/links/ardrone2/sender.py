"""What is sent to the drone, cycle by cycle: its state, and a last command that grows old.

The drone wants to hear something every 30 ms. What is repeated is the wish to fly or to land, and
the last command while it is young. A command that is older than `Limits.command_age` becomes
hovering; when none has come for `Limits.landing_after`, landing. All of it happens in the event
loop of the controller: if that hangs nothing is sent, and the drone's own watchdog takes over.
"""

from __future__ import annotations

from collections.abc import Sequence

from deadtime.links.ardrone2.commands import Command, Hover, Move, Ref, Watchdog, encode
from deadtime.links.safety import Limits, UnitCommand

__all__ = ["CYCLE", "CommandSender"]

#: Time between two datagrams, s.
CYCLE = 0.03


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
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.in_air = False
        self.guarded = False
        self.cut = False
        self.expired: str | None = None
        self._move: Move = Hover
        self._given = 0.0
        self._next = 1

    def fly(self) -> None:
        """Ask for taking off, or for staying in the air, hovering."""
        self.in_air, self.guarded, self.expired, self._move = True, False, None, Hover

    def guard(self, now: float) -> None:
        """From now on commands grow old."""
        self.guarded, self._given = True, now

    def land(self) -> None:
        """Ask for landing."""
        self.in_air, self.guarded, self._move = False, False, Hover

    def climb(self, share: UnitCommand, now: float) -> None:
        """Ask for a share of the largest vertical speed."""
        self._move, self._given = Move(gaz=share), now

    def hover(self, now: float) -> None:
        """Ask for no motion."""
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
        self._age(now)
        commands: list[Command] = [Ref(take_off=self.in_air, emergency=self.cut)]
        self.cut = False
        if alive:
            commands.append(Watchdog())
        commands.append(self._move)
        commands.extend(more)
        first, self._next = self._next, self._next + len(commands)
        return encode(commands, first)

    def _age(self, now: float) -> None:
        if not (self.in_air and self.guarded):
            return
        age = now - self._given
        if age > self.limits.command_age:
            self._move = Hover
        if age > self.limits.landing_after:
            self.land()
            self.expired = f"no command for {age:.2f} s: the vehicle was told to land"
