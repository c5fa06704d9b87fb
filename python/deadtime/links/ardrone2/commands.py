"""Commands to the drone, UDP 5556: one text line each, several in a datagram.

A number with a fraction is written as the 32 bits of its single-precision form, so that it comes
back rounded to 24 bits. The drone carries out a command only if its sequence number is above the
last one's; 1 starts again.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

from deadtime.links._native import at_read, at_write
from deadtime.links.safety import UnitCommand

NONE = UnitCommand(0.0)


class _Command:
    """A command: its name on the wire; its fields are the arguments, in their order there."""

    wire_name: ClassVar[str]

    def _arguments(self) -> tuple[Any, ...]:
        return tuple(vars(self).values())


class _Motion(_Command):
    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name != "flag" and type(value) is not UnitCommand:
                object.__setattr__(self, name, UnitCommand(value))

    def _arguments(self) -> tuple[Any, ...]:
        *motion, flag = vars(self).values()
        return flag, *motion


@dataclass(frozen=True)
class Ref(_Command):
    """``AT*REF``: be in the air, or on the ground. A state that is sent repeatedly.

    Attributes
    ----------
    take_off : bool
        In the air while set, landed while not.
    emergency : bool
        When it becomes set, the motors stop, or an emergency ends.
    """

    wire_name: ClassVar[str] = "REF"
    take_off: bool = False
    emergency: bool = False


@dataclass(frozen=True)
class Move(_Motion):
    """``AT*PCMD``: a motion, as shares of the configured largest ones.

    Attributes
    ----------
    roll, pitch, gaz, yaw : UnitCommand
        Right, backwards, up and clockwise positive. Other numbers are made into a `UnitCommand`.
    flag : int
        Bit 0: move (0: hover, and the rest is ignored); bit 1: combined yaw; bit 2: absolute.

    Raises
    ------
    ValueError
        If a value is not finite or lies outside of [-1, 1].
    """

    wire_name: ClassVar[str] = "PCMD"
    roll: UnitCommand = NONE
    pitch: UnitCommand = NONE
    gaz: UnitCommand = NONE
    yaw: UnitCommand = NONE
    flag: int = 1


#: No motion.
Hover = Move(flag=0)


@dataclass(frozen=True)
class MoveFrom(_Motion):
    """``AT*PCMD_MAG``: a motion relative to the heading of the sender; 1 is half a turn.

    Attributes
    ----------
    roll, pitch, gaz, yaw : UnitCommand
        As of `Move`.
    heading, accuracy : UnitCommand
        Heading of the sender, and its accuracy.
    flag : int
        As of `Move`.
    """

    wire_name: ClassVar[str] = "PCMD_MAG"
    roll: UnitCommand = NONE
    pitch: UnitCommand = NONE
    gaz: UnitCommand = NONE
    yaw: UnitCommand = NONE
    heading: UnitCommand = NONE
    accuracy: UnitCommand = NONE
    flag: int = 1


@dataclass(frozen=True)
class Config(_Command):
    """``AT*CONFIG``: one setting; the next one is sent after the acknowledgement of the drone."""

    wire_name: ClassVar[str] = "CONFIG"
    key: str
    value: str


@dataclass(frozen=True)
class ConfigIds(_Command):
    """``AT*CONFIG_IDS``: identifiers for the next setting, 8 hexadecimal digits each."""

    wire_name: ClassVar[str] = "CONFIG_IDS"
    session: str
    user: str
    application: str


@dataclass(frozen=True)
class Control(_Command):
    """``AT*CTRL``: 4 requests the configuration, 5 acknowledges, 6 requests the identifiers."""

    wire_name: ClassVar[str] = "CTRL"
    mode: int


@dataclass(frozen=True)
class Watchdog(_Command):
    """``AT*COMWDG``: the link is alive."""

    wire_name: ClassVar[str] = "COMWDG"


@dataclass(frozen=True)
class FlatTrim(_Command):
    """``AT*FTRIM``: the drone stands level; on the ground only."""

    wire_name: ClassVar[str] = "FTRIM"


@dataclass(frozen=True)
class Calibrate(_Command):
    """``AT*CALIB``: turn to calibrate a device (0: magnetometer); in the air only."""

    wire_name: ClassVar[str] = "CALIB"
    device: int = 0


@dataclass(frozen=True)
class Other(_Command):
    """Any other command, with its arguments as text between commas, quotes included."""

    wire_name: ClassVar[str] = "OTHER"
    name: str
    arguments: tuple[str, ...] = ()


Command: TypeAlias = (
    Ref | Move | MoveFrom | Config | ConfigIds | Control | Watchdog | FlatTrim | Calibrate | Other
)

_KINDS: dict[str, Any] = {
    kind.wire_name: kind
    for kind in (Ref, Config, ConfigIds, Control, Watchdog, FlatTrim, Calibrate)
}
_MOTIONS: dict[str, Any] = {kind.wire_name: kind for kind in (Move, MoveFrom)}


def encode(commands: Iterable[Command], first: int) -> bytes:
    r"""Write a datagram of commands with the sequence numbers from `first` on.

    Raises
    ------
    ValueError
        If it has more than 1024 bytes, if a text holds a quote or a sign that is not printable
        ASCII, or if a sequence number is beyond 31 bits.

    Examples
    --------
    >>> encode([Move(gaz=0.5)], 7)
    b'AT*PCMD=7,1,0,0,1056964608,0\r'
    """
    try:
        return at_write([(c.wire_name, c._arguments()) for c in commands], first)
    except OverflowError as error:
        raise ValueError(
            f"a command from {first} on contains a number that is not valid: {error}"
        ) from None


def decode(datagram: bytes) -> list[tuple[int, Command]]:
    r"""Read the commands of a datagram, each with its sequence number, in their order.

    A malformed command is skipped, as the drone ignores it: one without a carriage return or line
    feed at its end or not within the first 1024 bytes, with arguments missing or of another kind.
    Finite values of a motion are clipped to [-1, 1]; a motion with other values is skipped.

    Examples
    --------
    >>> decode(b"AT*REF=1,512\rAT*PCMD=2,1,0,0,nonsense,0\r")
    [(1, Ref(take_off=True, emergency=False))]
    """
    return [(read.sequence, _command(read.name, read.arguments)) for read in at_read(datagram)]


def _command(name: str, arguments: tuple[Any, ...]) -> Command:
    if name in _MOTIONS:
        flag, *motion = arguments
        return _MOTIONS[name](*motion, flag=flag)  # type: ignore[no-any-return]
    if name == "OTHER":
        return Other(arguments[0], tuple(arguments[1]))
    return _KINDS[name](*arguments)  # type: ignore[no-any-return]
