"""Flight modes of Betaflight and INAV, as the bits of their logs tell them."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

#: Bits that name a mode; the rest are switches, such as that of the beeper.
BETAFLIGHT_4_2 = {
    1: "ANGLE",
    2: "HORIZON",
    3: "MAG",
    4: "HEADFREE",
    5: "PASSTHRU",
    6: "FAILSAFE",
    7: "GPS RESCUE",
}
BETAFLIGHT_4_6 = {
    1: "ANGLE",
    2: "HORIZON",
    3: "MAG",
    4: "ALTHOLD",
    5: "HEADFREE",
    6: "CHIRP",
    7: "PASSTHRU",
    8: "FAILSAFE",
    9: "POSHOLD",
    10: "GPS RESCUE",
}
INAV = {
    1: "ANGLE",
    2: "HORIZON",
    3: "NAV ALTHOLD",
    4: "HEADING HOLD",
    5: "HEADFREE",
    8: "NAV RTH",
    9: "NAV POSHOLD",
    10: "MANUAL",
    14: "NAV LAUNCH",
    18: "FAILSAFE",
    19: "NAV WP",
    26: "TURN ASSIST",
    28: "AUTOTUNE",
}


def mode_bits(firmware: str) -> dict[int, str]:
    """The modes of a firmware, such as ``"Betaflight 4.5.1 (77d01ba3b) STM32F7X2"``."""
    found = re.match(r"(Betaflight|INAV) (\d{1,4})\.(\d{1,4})", firmware, re.IGNORECASE)
    if not found:
        return {}
    if found[1].lower() == "inav":
        return INAV
    # After 4.5 the versions go on with 4.6 or the year, 2025.12.
    version = int(found[2]), int(found[3])
    if version < (4, 2):
        return {}
    return BETAFLIGHT_4_2 if version < (4, 6) else BETAFLIGHT_4_6


def flight_modes(
    firmware: str, time: NDArray[np.float64], flags: NDArray[np.float64]
) -> tuple[tuple[float, str], ...]:
    """Modes with the times from which they hold; several at once joined by ``+``."""
    bits = mode_bits(firmware)
    if not bits:
        return ()
    modes: list[tuple[float, str]] = []
    changes = np.flatnonzero(np.diff(flags, prepend=-1.0))
    for k in changes:
        raised = int(flags[k])
        names = [name for bit, name in bits.items() if raised >> bit & 1]
        name = "+".join(names) or "ACRO"
        if not raised & 1:
            name = "DISARMED"
        # Damage can set the clock back; a mode before the last one would have no time to hold.
        if not modes or (modes[-1][1] != name and modes[-1][0] <= time[k]):
            modes.append((float(time[k]), name))
    return tuple(modes)
