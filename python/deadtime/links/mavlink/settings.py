"""What a link sets in a vehicle over MAVLink, and what it notices that others set and command."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.autopilots import Autopilot
from deadtime.links.mavlink.changed_parameters import ChangedParameters
from deadtime.links.mavlink.commanding import Commanding
from deadtime.links.mavlink.states import echo_of

#: Longest wait for news that make sure that it is on the ground, s: 5 heartbeats of one a second.
GROUND_KNOWN = 5.0

#: Number of times that parameters are put back where this was interrupted.
TRIES = 3


class Settings(Commanding):
    """The parameters of a vehicle."""

    _folder: Path | None
    _failing: str | None
    _meddled: str | None
    _asking: dict[str, asyncio.Task[None]]

    async def parameter(self, name: str) -> float:
        """The value of a parameter of the vehicle.

        Raises
        ------
        LinkError
            If it is not connected, or does not answer.
        """
        value = await self._held.read(name)
        if value is None:
            raise LinkError(f"{self.address}: the vehicle does not report its parameter {name}")
        return value

    async def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, and read it back; the old value is put back when the link is closed.

        Raises
        ------
        LinkError
            If it is not connected, or does not keep the value.
        """
        await self._held.set(name, value)

    async def shaping(self, axis: str) -> tuple[float, float | None] | None:
        """Within which limits the vehicle lets a commanded rate change, by its parameters.

        Parameters
        ----------
        axis : str
            One of `axes`.

        Returns
        -------
        (float, float or None) or None
            Largest rate of change, 1/s² times the unit of the axis, and largest rate of that,
            where it has one; None where the vehicle does not tell.

        Raises
        ------
        LinkError
            If it is not connected.
        """
        found: list[float | None] = []
        for parameter in self._known.shaping.get(axis, ()):
            value = None if parameter is None else await self._held.read(parameter.name)
            found.append(None if not value or parameter is None else parameter.factor * value)
        if not found or found[0] is None:
            return None
        return found[0], found[1]

    def _may_put_back(self) -> bool:
        """Whether the newest news make sure that it is on the ground."""
        # Who has armed it otherwise flies it, with the failsafes that it had.
        armed_here = self._authority.armed_here
        return self._reader.is_down if armed_here else self._reader.is_on_ground

    async def _put_back(self) -> str | None:
        held = self._parameters
        if held is None or not held.changed.changes:
            return None
        for _ in range(TRIES):  # news may contradict each other in between
            if self._silent or not await self._until(self._may_put_back, GROUND_KNOWN):
                break
            if await held.put_back(self._may_put_back) is None:
                break
        return held.left

    async def _recover(self, tell: Callable[[str], None]) -> None:
        """Put back what earlier runs have left changed, and tell it."""
        for left in ChangedParameters.left(self._held.changed.vehicle, self._folder):
            tell(
                f"{self.address}: the run of {left.written} was killed or lost its link, so "
                "changed parameters remain in the vehicle. Before, the vehicle had "
                f"{left.words()}. These values are restored before anything is set"
            )
            await self._until(self._may_put_back, GROUND_KNOWN)
            if since := await self._held.restore(left, self._may_put_back):
                tell(
                    f"{self.address}: somebody has changed these parameters since then, so they "
                    f"keep their values: {', '.join(since)}"
                )

    def _compare(self, message: Any, time: float, pilot: Autopilot) -> None:
        """Compare what the vehicle reports with what was commanded and set from here."""
        kind, points = message.get_type(), self._set_points
        if kind == "HEARTBEAT":
            self._authority.heard(self._reader, pilot, self._link, time)
            if self._authority.lost is not None:
                points.give_up(self._authority.lost)
        elif kind == "POSITION_TARGET_LOCAL_NED" and pilot.echoes:
            if points.are_not(echo := echo_of(message, time)):
                speeds = ", ".join(f"{speed:g}" for speed in echo[2:] if speed is not None)
                self._give_up(
                    f"the vehicle follows a setpoint of {speeds} m/s, which this program has not "
                    "sent"
                )
        elif self._parameters is not None and self._parameters.contradicts(message):
            name = message.param_id
            if name not in self._asking:
                self._asking[name] = asyncio.get_running_loop().create_task(self._ask(name))
        if self._reader.has_lost_position and self._authority.armed_here:
            self._failing = f"{self.address}: the vehicle {self._lost_position}"

    async def _ask(self, name: str) -> None:
        """Ask for a parameter that a message contradicts; give the flight up if it is true."""
        try:
            self._meddled = self._meddled or await self._held.changed_elsewhere(name)
        finally:
            del self._asking[name]
        if self._meddled is not None:
            self._give_up(self._meddled)

    def _give_up(self, why: str) -> None:
        others = self._link.senders.named
        self._set_points.give_up(
            f"{self.address}: {why}{others}: the vehicle was commanded to land"
        )
