"""The protocol of a vehicle, independent of its wire format."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple, Protocol, Self


class Motion(NamedTuple):
    """Speeds in m/s, and a rate of turn in rad/s, clockwise positive; None holds the heading."""

    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    turn: float | None = None


class Echo(NamedTuple):
    """What a vehicle says that it follows.

    Attributes
    ----------
    time : float
        Arrival of the message, s of `deadtime.links.now`.
    vehicle_time : float
        Clock of the vehicle at the message, s.
    north, east, up : float or None
        The speeds that it follows, m/s.
    """

    time: float
    vehicle_time: float
    north: float | None
    east: float | None
    up: float | None


@dataclass(frozen=True)
class VehicleState:
    """The state of a vehicle from one of its messages.

    Attributes
    ----------
    time : float
        Arrival of the message, s of `deadtime.links.now`.
    height : float
        Above the ground, m.
    flying : bool
        In the air under control: off the ground and not landing.
    landed : bool
        On the ground with its motors off.
    sequence : int
        Number of the message, counted by the vehicle.
    vehicle_time : float, optional
        Clock of the vehicle at the message, s.
    climb : float, optional
        Vertical speed, m/s, up positive.
    climb_setpoint : float, optional
        The vertical speed that the vehicle follows, m/s, up positive: its echo of the commands that
        have arrived.
    roll, pitch : float
        rad.
    north, east : float, optional
        Position in the vehicle's own frame, m.
    north_speed, east_speed : float, optional
        m/s.
    yaw : float, optional
        Heading, rad, clockwise from north.
    yaw_rate : float, optional
        rad/s, clockwise positive.
    north_setpoint, east_setpoint : float, optional
        The horizontal speeds that the vehicle follows, m/s.
    battery : float, optional
        Charge left, percent.
    emergency : bool
        The vehicle has cut its motors.
    fault : str, optional
        Fault reported by the vehicle, as a clause: "its ultrasound receives no echo".
    missing : int
        Largest number of successive messages lost in the last second.
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
    north: float | None = None
    east: float | None = None
    north_speed: float | None = None
    east_speed: float | None = None
    yaw: float | None = None
    yaw_rate: float | None = None
    north_setpoint: float | None = None
    east_setpoint: float | None = None


class Vehicle(Protocol):
    """A vehicle whose speeds can be commanded, or some of them.

    As an asynchronous context manager it connects on entry, and lands and closes on exit, also by
    an exception. Connecting never takes off.
    """

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that can be commanded, of ``z``, ``x``, ``y`` and ``yaw``."""

    async def connect(self) -> None:
        """Open the link and set the limits of the vehicle.

        Raises
        ------
        LinkError
            If the vehicle does not answer, or does not accept a limit.
        """

    async def take_off(self) -> None:
        """Take off; returns when the vehicle holds its height and accepts commands."""

    async def state(self) -> VehicleState:
        """The newest message of the vehicle; waits for the first.

        Raises
        ------
        LinkError
            If the link is lost.
        """

    def command(self, climb: float) -> float:
        """Command a vertical speed in m/s, up positive; return the one that was sent after limits.

        A command is valid for a short time only; without a new one the vehicle hovers.

        Raises
        ------
        ValueError
            If `climb` is not finite.
        """

    def command_velocity(
        self, north: float = 0.0, east: float = 0.0, up: float = 0.0, turn: float | None = None
    ) -> Motion:
        """Command a motion as `command` does a climb; return the one that was sent after limits.

        Raises
        ------
        ValueError
            If a number is not finite, or is not zero for an axis that the vehicle does not have.
        """

    def hover(self) -> None:
        """Command no motion."""

    async def land(self) -> None:
        """Land; returns when the vehicle is on the ground. May be called at any time, and again."""

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
