"""What every vehicle can be asked, whatever its wire protocol."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

__all__ = ["Vehicle", "VehicleState"]


@dataclass(frozen=True)
class VehicleState:
    """What a vehicle said of itself in one message.

    Attributes
    ----------
    time : float
        When the message arrived, s of `deadtime.links.now`.
    height : float
        Above the ground, m.
    flying : bool
        In the air under its own control: off the ground and not on the way down to it.
    landed : bool
        On the ground with its motors off.
    sequence : int
        Number of the message, as the vehicle counts.
    vehicle_time : float, optional
        The vehicle's own clock at the message, s.
    climb : float, optional
        Vertical speed, m/s, up positive.
    climb_setpoint : float, optional
        The vertical speed that the vehicle is following, m/s, up positive: its echo of the
        commands that have reached it.
    roll, pitch : float
        rad.
    battery : float, optional
        Charge left, percent.
    emergency : bool
        The vehicle has cut its motors.
    fault : str, optional
        What the vehicle says is wrong with it, to follow "that": "its ultrasound is deaf".
    missing : int
        Messages lost in a row, the most in the second before this one.
    """

    time: float
    height: float
    flying: bool
    landed: bool
    sequence: int
    vehicle_time: float | None = None
    climb: float | None = None
    climb_setpoint: float | None = None
    roll: float = 0.0
    pitch: float = 0.0
    battery: float | None = None
    emergency: bool = False
    fault: str | None = None
    missing: int = 0


class Vehicle(Protocol):
    """A vehicle whose climb can be commanded.

    As an asynchronous context manager it is connected on entry, and landed and closed on the way
    out, whatever the reason. Connecting never takes off.
    """

    async def connect(self) -> None:
        """Make the link and set the vehicle's own limits.

        Raises
        ------
        LinkError
            If the vehicle does not answer, or does not take over a limit.
        """

    async def take_off(self) -> None:
        """Leave the ground; returns when the vehicle holds its height and takes commands."""

    async def state(self) -> VehicleState:
        """The newest message of the vehicle; waits for the first.

        Raises
        ------
        LinkError
            If the link is lost.
        """

    def command(self, climb: float) -> float:
        """Ask for a vertical speed in m/s, up positive; return what was sent after limits.

        A command is good for a short while only: who stops commanding hovers.

        Raises
        ------
        ValueError
            If `climb` is not finite.
        """

    def hover(self) -> None:
        """Ask for no motion."""

    async def land(self) -> None:
        """Land; returns when the vehicle is on the ground. May be called at any time, and twice."""

    async def close(self) -> None:
        """End the link; a vehicle in the air is landed first."""

    async def __aenter__(self) -> Self:
        """Connect."""

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Land and close."""
