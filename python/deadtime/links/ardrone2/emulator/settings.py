"""The configuration of an emulated drone: which keys it has, and what it takes for them.

A number outside its range is taken as the nearest one inside; a value of the wrong kind, a key
that can only be read and an unknown key change nothing and are not acknowledged. Whoever sets a
limit has to read it back.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal

__all__ = ["NAVDATA_OPTIONS", "Settings"]

#: DEMO and VISION_DETECT.
NAVDATA_OPTIONS = 65537

#: No value is longer.
LONGEST = 64

NO_ID = "00000000"

Kind = Literal["whole", "number", "truth", "text", "id", "fixed"]


@dataclass(frozen=True)
class Entry:
    """One key: its value when switched on, its kind, and its range where it is a number."""

    value: str
    kind: Kind = "fixed"
    low: float = -math.inf
    high: float = math.inf


# Ranges of the developer guide; what it leaves open is wide.
ENTRIES: dict[str, Entry] = {
    "general:num_version_config": Entry("1"),
    "general:num_version_soft": Entry("2.4.8"),
    "general:drone_serial": Entry("EMULATED"),
    "general:ardrone_name": Entry("deadtime emulator", "text"),
    "general:navdata_demo": Entry("TRUE", "truth"),
    "general:navdata_options": Entry(str(NAVDATA_OPTIONS), "whole", 0, 2**31 - 1),
    "general:com_watchdog": Entry("2"),
    "general:video_enable": Entry("TRUE", "truth"),
    "general:vision_enable": Entry("TRUE", "truth"),
    "control:control_level": Entry("0", "whole", 0, 3),
    "control:euler_angle_max": Entry("2.0943952e-01", "number", 0.0, 0.52),
    "control:altitude_max": Entry("3000", "whole", 500, 100_000),
    "control:altitude_min": Entry("50", "whole", 50, 1000),
    "control:control_vz_max": Entry("7.0000000e+02", "number", 200.0, 2000.0),
    "control:control_yaw": Entry("1.7453293e+00", "number", 0.7, 6.11),
    "control:outdoor": Entry("FALSE", "truth"),
    "control:flight_without_shell": Entry("FALSE", "truth"),
    "control:indoor_euler_angle_max": Entry("2.0943952e-01", "number", 0.0, 0.52),
    "control:indoor_control_vz_max": Entry("7.0000000e+02", "number", 200.0, 2000.0),
    "control:indoor_control_yaw": Entry("1.7453293e+00", "number", 0.7, 6.11),
    "control:outdoor_euler_angle_max": Entry("3.4906584e-01", "number", 0.0, 0.52),
    "control:outdoor_control_vz_max": Entry("1.0000000e+03", "number", 200.0, 2000.0),
    "control:outdoor_control_yaw": Entry("3.4906585e+00", "number", 0.7, 6.11),
    "control:flying_mode": Entry("0", "whole", 0, 3),
    "video:video_codec": Entry("32", "whole", 0, 255),
    "video:codec_fps": Entry("30", "whole", 15, 30),
    "video:video_channel": Entry("0", "whole", 0, 3),
    "video:bitrate_ctrl_mode": Entry("0", "whole", 0, 2),
    "leds:leds_anim": Entry("0,0,0", "text"),
    "detect:detect_type": Entry("3", "whole", 0, 13),
    "custom:session_id": Entry(NO_ID, "id"),
    "custom:profile_id": Entry(NO_ID, "id"),
    "custom:application_id": Entry(NO_ID, "id"),
}

IDS = ("custom:session_id", "custom:profile_id", "custom:application_id")

#: Keys that exist once for indoors and once for outdoors; `control:outdoor` says which holds.
PAIRED = ("euler_angle_max", "control_vz_max", "control_yaw")


class Settings:
    """The configuration of one drone.

    Examples
    --------
    >>> settings = Settings()
    >>> settings.set("control:control_vz_max", "9000"), settings.climb_limit
    (True, 2.0)
    >>> settings.set("control:control_vz_max", "nan"), settings.set("control:flight_anim", "1,5")
    (False, False)
    """

    def __init__(self) -> None:
        self.values = {key: entry.value for key, entry in ENTRIES.items()}

    def set(self, key: str, value: str) -> bool:
        """Take a value; False if it is not acknowledged."""
        entry = ENTRIES.get(key)
        told = None if entry is None else _taken(entry, value)
        if told is None:
            return False
        self.values[key] = told
        section, _, name = key.partition(":")
        if section == "control":
            self._keep_pairs(name)
        return True

    def _keep_pairs(self, name: str) -> None:
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
        """Session, profile (user) and application that the configuration is set for."""
        session, user, application = (self.values[key] for key in IDS)
        return session, user, application

    @property
    def asks_for_ids(self) -> bool:
        """Whether a CONFIG needs a CONFIG_IDS before it."""
        return any(one != NO_ID for one in self.ids)

    @property
    def outdoor(self) -> bool:
        """Whether the outdoor limits hold."""
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
        """The climb that one unit of gaz asks for, m/s."""
        return float(self.values["control:control_vz_max"]) / 1000.0

    @property
    def angle_limit(self) -> float:
        """The roll or pitch that one unit asks for, rad."""
        return float(self.values["control:euler_angle_max"])

    @property
    def turn_limit(self) -> float:
        """The turning speed that one unit of yaw asks for, rad/s."""
        return float(self.values["control:control_yaw"])

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest height in flight, m."""
        return (
            int(self.values["control:altitude_min"]) / 1000.0,
            int(self.values["control:altitude_max"]) / 1000.0,
        )


def _taken(entry: Entry, value: str) -> str | None:
    """What is kept of a value, None if it is refused."""
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
