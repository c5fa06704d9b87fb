"""Who flies the vehicle: this link, or somebody else who has taken it over.

The vehicle reports its mode and whether it is armed. What this link did not command was done by
somebody else, a pilot with a transmitter or another ground station, or by a failsafe of the
vehicle. Neither is contradicted.
"""

from __future__ import annotations

import math

from deadtime._base.errors import LinkError
from deadtime.links.mavlink.autopilots import Autopilot
from deadtime.links.mavlink.connection import Connection
from deadtime.links.mavlink.states import StateReader

#: Warnings of the vehicle this long before a change of its mode may be its reason, s.
REASON = 3.0


class Authority:
    """Compares what the vehicle does with what was commanded.

    Parameters
    ----------
    name : str
        The vehicle, for messages.

    Attributes
    ----------
    arming : bool
        Whether it is just being armed from here.
    armed_at : float
        When it was armed from here, s; infinite while it is not.
    lost : str or None
        How somebody else took it over.
    disarmed : str or None
        How somebody else disarmed it, so that it is not armed again.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.arming = False
        self.armed_at = math.inf
        self.lost: str | None = None
        self.disarmed: str | None = None
        self._modes: tuple[int, ...] = ()
        self._landing: int | None = None
        self._was_armed = False

    @property
    def armed_here(self) -> bool:
        """Whether this link armed it, and it has not landed since."""
        return self.armed_at < math.inf

    @property
    def holds(self) -> bool:
        """Whether this link may command it."""
        return self.armed_here and self.lost is None

    def refuse_armed(self, reader: StateReader) -> None:
        """Raise for a vehicle that is armed, and not from here."""
        if reader.armed and not self.armed_here:
            raise LinkError(
                f"{self._name}: the vehicle is armed already, and not by this link: whoever armed "
                "it flies it"
            )

    def fly(self, *modes: int) -> None:
        """It is flown in one of these modes from now on."""
        self._modes, self._landing = modes, None

    def land(self, mode: int) -> None:
        """It was commanded to land in this mode."""
        self._landing = mode

    def ended(self) -> None:
        """The flight has ended on the ground."""
        self.armed_at, self._modes, self._landing = math.inf, (), None

    def heard(self, reader: StateReader, pilot: Autopilot, link: Connection, time: float) -> None:
        """Compare a heartbeat with what was commanded."""
        if self._was_armed and not reader.armed and self._landing is None and not self.arming:
            said = link.said(time - REASON)
            self.disarmed = (
                f"{self._name}: the vehicle was disarmed, and not from here{said}: it is not armed "
                "again. Connect again when whoever did it agrees"
            )
            self.lost = self.lost or self.disarmed
        self._was_armed = bool(reader.armed)
        if not self._modes or self.lost is not None or not reader.armed:
            return
        if self._landing is not None and reader.mode == self._landing:
            self._modes = (self._landing,)  # it obeys, and has to stay in this mode
        elif reader.mode not in self._modes:
            self.take_over(reader, pilot, link)

    def take_over(self, reader: StateReader, pilot: Autopilot, link: Connection) -> None:
        """Note that the mode was changed, and by whom as far as it is known."""
        heartbeat = link.latest.get("HEARTBEAT")
        time = heartbeat[0] if heartbeat is not None else 0.0
        others = "".join(f"; on the link is {one}" for one in link.senders.ground_stations)
        name = pilot.mode_name(-1 if reader.mode is None else reader.mode)
        self.lost = self.lost or (
            f"{self._name}: the vehicle went to {name}, which was not commanded from here{others}"
            f"{link.said(time - REASON)}: no set points are sent any more"
        )
