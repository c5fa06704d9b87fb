"""What links to all vehicles do alike: connect, take off, hover, land, close.

A flight ends on the ground, in a bounded time: whatever ends a take-off or a flight, the vehicle is
commanded to land, and waited for. Each vehicle says how that is commanded and reported.
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Self

from deadtime._base.errors import FlightAbortedError, LinkError
from deadtime.links.clock import now
from deadtime.links.expiry import ExpiringCommand
from deadtime.links.safety import Limits
from deadtime.links.uninterrupted import note, uninterrupted
from deadtime.links.vehicle import VehicleState

#: Time between two checks of the link while nothing else is waited for, s.
CHECK_EVERY = 0.1


class VehicleLink(ABC):
    """A link to one vehicle.

    Attributes
    ----------
    limits : Limits
        Limits of its flights.
    """

    limits: Limits

    #: Longest duration of a take-off until the height is held, and of a landing, and longest
    #: silence while landing, s.
    longest_take_off: ClassVar[float]
    longest_landing: ClassVar[float]
    longest_silence: ClassVar[float]
    #: What lands a vehicle that is not heard any more.
    lands_unheard: ClassVar[str]

    # What a vehicle says

    @property
    @abstractmethod
    def _name(self) -> str:
        """The vehicle, for messages."""

    @property
    @abstractmethod
    def _is_open(self) -> bool:
        """Whether the link is open."""

    @property
    @abstractmethod
    def _newest(self) -> VehicleState | None:
        """The newest state."""

    @property
    @abstractmethod
    def _listener_failure(self) -> Exception | None:
        """The error of a listener."""

    @property
    @abstractmethod
    def _silence(self) -> float:
        """Time since the last message of the vehicle, s."""

    @property
    @abstractmethod
    def _commanded(self) -> ExpiringCommand:
        """What is commanded, until it expires."""

    @abstractmethod
    async def _until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until a condition holds after a message; False after the timeout, s."""

    @abstractmethod
    async def _first_state(self) -> None:
        """Wait for the first state.

        Raises
        ------
        LinkError
            If none comes.
        """

    @abstractmethod
    def _check_vehicle(self) -> None:
        """Raise if the vehicle is silent, or somebody else commands it."""

    # What a vehicle does

    @abstractmethod
    async def _open(self) -> None:
        """Open a new link."""

    @abstractmethod
    async def _configure(self) -> None:
        """Set the limits of the vehicle."""

    @abstractmethod
    async def _put_back(self) -> str | None:
        """Put back what was set; a sentence about what could not be."""

    @abstractmethod
    def _shut(self) -> None:
        """Command a landing, and close the link."""

    @abstractmethod
    async def _prepare(self) -> None:
        """Refuse a vehicle that must not take off."""

    @abstractmethod
    async def _climb(self) -> None:
        """Take off, and wait until the height is held."""

    @abstractmethod
    def _stop(self) -> bool:
        """Stop the motion, and command the landing; whether there is one to wait for."""

    @abstractmethod
    def _is_down(self) -> bool:
        """Whether it is on the ground."""

    @abstractmethod
    def _send(self) -> None:
        """Send what is commanded at once."""

    @abstractmethod
    def _keep_landing(self, passed: float) -> None:
        """Do what a landing needs while it is waited for; `passed` is its duration, s."""

    @abstractmethod
    def _landed(self) -> None:
        """Note that the flight has ended on the ground."""

    def _said(self, since: float) -> str:
        """What the vehicle has said since a time, s, as a clause."""
        return ""

    @property
    def _remark(self) -> str | None:
        """What else is known of why the flight ended, as a sentence."""
        return None

    def _age(self) -> None:
        """Let commands expire."""
        self._commanded.age(now())

    # Connecting

    async def connect(self) -> None:
        """Open the link, and set the limits of the vehicle; it stays on the ground.

        Raises
        ------
        LinkError
            If the vehicle does not answer, must not be flown, or does not keep a setting.
        """
        if self._is_open:
            raise LinkError(f"{self._name} is connected already")
        await self._open()
        try:
            await self._configure()
        except BaseException as error:
            note(error, await self._put_back())
            self._shut()
            raise

    # In the air

    async def take_off(self) -> None:
        """Take off; returns when the vehicle holds its height.

        Raises
        ------
        LinkError
            If it is not connected, not on the ground, reports a fault, is low on battery, or is not
            up in time; it is then commanded to land.
        """
        await self._prepare()
        try:
            await self._climb()
        except BaseException:
            self._stop()
            raise

    async def _wait_up(self, is_up: Callable[[], bool]) -> None:
        begin = now()
        while not await self._until(is_up, CHECK_EVERY):
            self._check_link()
            if now() - begin > self.longest_take_off:
                raise LinkError(
                    f"{self._name} has not reached its height {self.longest_take_off:g} s after "
                    f"the take-off{self._said(begin)}"
                )

    async def state(self) -> VehicleState:
        """The newest state; waits for the first.

        Raises
        ------
        LinkError
            If the vehicle sends nothing, or the flight has ended without `land`, as of `command`.
        """
        if not self._is_open:
            raise LinkError(f"{self._name} is not connected")
        if self._newest is None:
            await self._first_state()
        self._check_link()
        assert self._newest is not None
        return self._newest

    def _check_link(self) -> None:
        failure = self._listener_failure
        if failure is not None:
            raise LinkError(f"the listener of {self._name} has failed: {failure}") from failure
        self._check_flight()
        self._check_vehicle()

    def _check_flight(self) -> None:
        """Raise if the flight has ended without `land`."""
        self._age()
        if self._commanded.expired is not None:
            self._send()
            raise FlightAbortedError(self._commanded.expired)

    def _check_in_air(self) -> None:
        """Raise if no motion can be commanded."""
        if self._commanded.expired is None and not self._commanded.guarded:
            raise LinkError(f"{self._name} is not in the air: take off before giving commands")
        self._check_flight()

    def hover(self) -> None:
        """Command no motion; like a command this is valid for a short time, then it lands.

        Raises
        ------
        LinkError
            If the flight has ended without `land`, as of `command`.
        """
        self._check_flight()
        self._commanded.hover(now())
        self._send()

    # Landing

    async def land(self) -> None:
        """Land; returns when the vehicle is on the ground.

        Raises
        ------
        LinkError
            If it does not report this in time, sends nothing, or is flown by somebody else.
        """
        if not self._stop():
            return
        begin = now()
        while not await self._until(self._is_down, CHECK_EVERY):
            self._keep_landing(now() - begin)
            if self._silence > self.longest_silence:
                raise LinkError(
                    f"nothing has been received from {self._name} for {self._silence:.1f} s "
                    f"during the landing, but {self.lands_unheard}"
                )
            if now() - begin > self.longest_landing:
                raise LinkError(f"{self._name} has not landed after {self.longest_landing:g} s")
        self._landed()

    async def close(self) -> None:
        """Land if in the air, put back what was set in the vehicle, and close the link.

        Raises
        ------
        LinkError
            As `land` does; the link is closed nevertheless.

        Warns
        -----
        RuntimeWarning
            If it has landed and a setting could not be put back.
        """
        await self._close(None)

    async def _close(self, reason: BaseException | None) -> None:
        try:
            await uninterrupted(self._end())
        finally:
            if reason is not None:
                note(reason, self._remark)
            self._shut()

    async def _end(self) -> None:
        try:
            await self.land()
        except LinkError as error:
            note(error, await self._put_back())
            raise
        kept = await self._put_back()
        if kept is not None:
            warnings.warn(kept, RuntimeWarning, stacklevel=2)

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            await self._close(error)
        except LinkError as problem:
            if error is None:
                raise
            note(error, str(problem), *getattr(problem, "__notes__", ()))
