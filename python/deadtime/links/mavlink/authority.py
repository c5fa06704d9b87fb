"""Who flies the vehicle: this link, or somebody else who has taken it over.

The vehicle reports its mode and whether it is armed. What this link did not command was done by
somebody else, a pilot with a transmitter or another ground station, or by a failsafe of the
vehicle. Neither is contradicted. Messages may be forged or late, so that a flight is given up when
two agree; what was given up is this link's to land again when later ones contradict them.
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
        How somebody else took it over, by messages that agree. Later ones that contradict revise
        it, until it is sure.
    is_sure : bool
        Whether it is sure that somebody else took it over.
    disarmed : str or None
        How somebody else disarmed it, so that it is not armed again.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.arming = False
        self.armed_at = math.inf
        self.lost: str | None = None
        self.is_sure = False
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
        """Raise for a vehicle that is armed, but not by this link."""
        if reader.armed and not self.armed_here:
            raise LinkError(
                f"{self._name}: the vehicle is armed already, but not by this link, so somebody "
                "else is flying the vehicle"
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
        """Compare what heartbeats say with what was commanded."""
        armed, mode = reader.armed, reader.mode
        if armed is None or mode is None or self.is_sure:
            return
        if self._landing is not None and armed and mode == self._landing:
            self._modes = (self._landing,)  # it obeys, and has to stay in this mode
        if armed:
            self.disarmed = None
        elif self._was_armed and self._landing is None and not self.arming:
            self.disarmed = self._was_disarmed(link, time)
        left = armed and self._modes and mode not in (*self._modes, self._landing)
        if left:
            self.lost = self.lost or self._was_taken(mode, pilot, link, time)
            if reader.has_lost_position and "position estimate" not in self.lost:
                self.lost += ". The vehicle has also lost its position estimate"
            self.is_sure = reader.modes.is_sure(mode)
        elif self.disarmed is not None:
            self.lost = self.lost or self.disarmed
            self.is_sure = reader.arming.is_sure(False)
        else:
            self.lost = None
        # What it did before it was disarmed from elsewhere counts until that is revised.
        self._was_armed = armed or self.disarmed is not None

    def _was_disarmed(self, link: Connection, time: float) -> str:
        return (
            f"{self._name}: the vehicle was disarmed, but not by this "
            f"link{link.said(time - REASON)}. This link does not arm it again. Connect again "
            "when the person who disarmed the vehicle agrees"
        )

    def _was_taken(self, mode: int, pilot: Autopilot, link: Connection, time: float) -> str:
        return (
            f"{self._name}: the vehicle went to {pilot.mode_name(mode)}, which was not commanded "
            f"from here{link.senders.named}{link.said(time - REASON)}: no set points are sent any "
            "more"
        )
