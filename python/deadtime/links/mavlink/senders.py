"""Who sends on a link: the vehicle, and others, who are ignored and named."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from deadtime.links.mavlink.codec import dialect

#: The component of an autopilot.
AUTOPILOT = 1

#: Senders that are kept (bounds memory: ids can be forged).
MOST = 64


@dataclass
class Foreign:
    """A sender that is not the vehicle.

    Attributes
    ----------
    system, component : int
    frames : int
    kind : str
        What it says it is, by its heartbeat.
    """

    system: int
    component: int
    frames: int = 0
    kind: str = "unknown"

    def __str__(self) -> str:
        return f"{self.kind}, system {self.system}, component {self.component}"


@dataclass
class Senders:
    """Tells frames of the vehicle from those of others.

    Attributes
    ----------
    own : (int, int)
        System and component of this end.
    vehicle : int or None
        System of the vehicle; None until its first heartbeat.
    foreign : dict
        The others by their ids.
    elsewhere : int
        Datagrams from other addresses than that of the vehicle.
    """

    own: tuple[int, int]
    vehicle: int | None = None
    foreign: dict[tuple[int, int], Foreign] = field(default_factory=dict)
    elsewhere: int = 0

    def is_vehicle(self, message: Any) -> bool:
        """Whether the vehicle sent it; others are counted."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        if self.vehicle is None and is_autopilot(message):
            self.vehicle = system
        if system == self.vehicle and component == AUTOPILOT:
            return True
        self._count(message, system, component)
        return False

    def _count(self, message: Any, system: int, component: int) -> None:
        if (system, component) not in self.foreign and len(self.foreign) >= MOST:
            return
        sender = self.foreign.setdefault((system, component), Foreign(system, component))
        sender.frames += 1
        if message.get_type() == "HEARTBEAT":
            d = dialect()
            if is_autopilot(message):
                sender.kind = "another vehicle"
            elif message.type == d.MAV_TYPE_GCS:
                sender.kind = "another ground station"
                if (system, component) == self.own:
                    sender.kind = "another ground station with the same ids as this program"
            else:
                sender.kind = "another component"

    @property
    def ground_stations(self) -> list[Foreign]:
        """Other ground stations."""
        return [sender for sender in self.foreign.values() if "ground station" in sender.kind]

    @property
    def named(self) -> str:
        """Other ground stations as a clause, or nothing."""
        return "".join(
            f". Another sender on the link is {station}" for station in self.ground_stations
        )

    @property
    def vehicles(self) -> list[Foreign]:
        """Other vehicles."""
        return [sender for sender in self.foreign.values() if sender.kind == "another vehicle"]


def is_autopilot(message: Any) -> bool:
    """Whether it is the heartbeat of an autopilot."""
    d = dialect()
    return bool(
        message.get_type() == "HEARTBEAT"
        and message.get_srcComponent() == AUTOPILOT
        and message.type != d.MAV_TYPE_GCS
        and message.autopilot != d.MAV_AUTOPILOT_INVALID
    )
