"""Flight modes and kinds of vehicles of PX4 by their numbers."""

from __future__ import annotations

#: ``vehicle_status.nav_state``.
MODES = {
    0: "Manual", 1: "Altitude", 2: "Position", 3: "Mission", 4: "Hold", 5: "Return",
    6: "Position slow", 8: "Altitude cruise", 10: "Acro", 12: "Descend", 13: "Termination",
    14: "Offboard", 15: "Stabilized", 17: "Takeoff", 18: "Land", 19: "Follow me",
    20: "Precision land", 21: "Orbit", 22: "VTOL takeoff",
}  # fmt: skip

#: The modes that close the horizontal loops, and those that close the vertical ones.
HORIZONTAL = frozenset({
    "Position", "Mission", "Hold", "Return", "Position slow", "Offboard", "Takeoff", "Land",
    "Follow me", "Precision land", "Orbit", "VTOL takeoff",
})  # fmt: skip
VERTICAL = HORIZONTAL | {"Altitude", "Altitude cruise", "Descend"}

#: ``MAV_TYPE`` of a heartbeat, ``vehicle_status.system_type``.
VEHICLES = {
    1: "fixed wing", 2: "quadrotor", 3: "coaxial", 4: "helicopter", 7: "airship", 10: "rover",
    11: "boat", 12: "submarine", 13: "hexarotor", 14: "octorotor", 15: "tricopter",
    19: "VTOL tail-sitter", 20: "VTOL tail-sitter", 21: "VTOL tiltrotor", 22: "VTOL",
    23: "VTOL tail-sitter", 29: "dodecarotor",
}  # fmt: skip


def version_of(number: int) -> str:
    """A version such as ``"v1.14.3"``; the last byte of its number is the kind of release."""
    return "v" + ".".join(str(number >> shift & 0xFF) for shift in (24, 16, 8))
