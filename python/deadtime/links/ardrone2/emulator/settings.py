"""The configuration of an emulated drone, and the values it accepts.

A number outside its range is replaced by the nearest one inside. A value of the wrong kind is
ignored, as is any value for a read-only key. Every setting of a known key is acknowledged, even if
nothing changes: the acknowledgement only means that the setting was received, so a client has to
read a limit back. An unknown key is not acknowledged.
"""

from __future__ import annotations

import math
import re

from deadtime.links.ardrone2.emulator.configuration_keys import ENTRIES, LONGEST, NO_ID, Entry

IDS = ("custom:session_id", "custom:profile_id", "custom:application_id")

#: Keys with separate values for indoors and outdoors; `control:outdoor` selects which applies.
PAIRED = ("euler_angle_max", "control_vz_max", "control_yaw")


class Settings:
    """The configuration of one drone.

    Examples
    --------
    >>> settings = Settings()
    >>> settings.set("control:control_vz_max", "9000"), settings.climb_limit
    (True, 2.0)
    >>> settings.set("control:control_vz_max", "nan"), settings.climb_limit
    (True, 2.0)
    >>> settings.set("control:control_vz_maximum", "500")
    False
    """

    def __init__(self) -> None:
        self.values = {key: entry.value for key, entry in ENTRIES.items()}

    def set(self, key: str, value: str) -> bool:
        """Set a value if it is valid; False if the drone has no such key."""
        if key not in ENTRIES:
            return False
        accepted = _accepted(ENTRIES[key], value)
        if accepted is None:
            return True
        self.values[key] = accepted
        section, _, name = key.partition(":")
        if section == "control":
            self._update_pairs(name)
        return True

    def _update_pairs(self, name: str) -> None:
        place = "outdoor" if self.outdoor else "indoor"
        if name == "outdoor":
            for paired in PAIRED:
                self.values[f"control:{paired}"] = self.values[f"control:{place}_{paired}"]
        elif name in PAIRED:
            self.values[f"control:{place}_{name}"] = self.values[f"control:{name}"]
        elif name.removeprefix(f"{place}_") in PAIRED:
            self.values[f"control:{name.removeprefix(f'{place}_')}"] = self.values[
                f"control:{name}"
            ]

    @property
    def ids(self) -> tuple[str, str, str]:
        """Session, profile (user) and application to which the configuration belongs."""
        session, user, application = (self.values[key] for key in IDS)
        return session, user, application

    @property
    def asks_for_ids(self) -> bool:
        """Whether a CONFIG needs a CONFIG_IDS before it."""
        return any(identifier != NO_ID for identifier in self.ids)

    @property
    def outdoor(self) -> bool:
        """Whether the outdoor limits apply."""
        return self.values["control:outdoor"] == "TRUE"

    @property
    def demo(self) -> bool:
        """Whether navdata are of the short, slow kind."""
        return self.values["general:navdata_demo"] == "TRUE"

    @property
    def options(self) -> int:
        """The options of short navdata, one bit a tag."""
        return int(self.values["general:navdata_options"])

    @property
    def climb_limit(self) -> float:
        """The climb for a gaz of 1, m/s."""
        return float(self.values["control:control_vz_max"]) / 1000.0

    @property
    def angle_limit(self) -> float:
        """The angle for a roll or pitch of 1, rad."""
        return float(self.values["control:euler_angle_max"])

    @property
    def turn_limit(self) -> float:
        """The turning speed for a yaw of 1, rad/s."""
        return float(self.values["control:control_yaw"])

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest height in flight, m."""
        return (
            int(self.values["control:altitude_min"]) / 1000.0,
            int(self.values["control:altitude_max"]) / 1000.0,
        )


def _accepted(entry: Entry, value: str) -> str | None:
    """The value as it is stored; None if it is refused."""
    value = value.strip()
    if entry.kind == "truth" and value.upper() in ("TRUE", "FALSE"):
        return value.upper()
    if entry.kind == "text" and len(value) <= LONGEST and value.isascii() and value.isprintable():
        return value
    if entry.kind == "id" and value.startswith("-"):  # "-all" and "-<id>" remove
        return NO_ID
    if entry.kind == "id" and re.fullmatch(r"[0-9a-fA-F]{8}", value):
        return value.lower()
    if entry.kind in ("whole", "number"):
        return _number(entry, value)
    return None


def _number(entry: Entry, value: str) -> str | None:
    if len(value) > LONGEST:
        return None
    try:
        number = float(value)
    except ValueError:
        return None
    if not math.isfinite(number):
        return None
    number = min(max(number, entry.low), entry.high)
    return str(round(number)) if entry.kind == "whole" else f"{number:.7e}"
