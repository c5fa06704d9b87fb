"""The tables of the autopilots; each is imported when a log of it is opened."""

from __future__ import annotations

import importlib

from deadtime.recordings.logs._contents import LogContents
from deadtime.recordings.logs._names import AutopilotNames

#: The file with the function ``names(contents) -> AutopilotNames`` of each autopilot.
TABLES = {
    "PX4": "_px4",
    "ArduPilot": "_ardupilot",
    "Betaflight": "_betaflight",
    "INAV": "_betaflight",
    "Crazyflie": "_crazyflie_loops",
}


def names_of(contents: LogContents) -> AutopilotNames:
    """The loops that logs of this autopilot can hold; none of an unknown one."""
    if contents.autopilot not in TABLES:
        return AutopilotNames(())
    table = importlib.import_module(f"deadtime.recordings.logs.{TABLES[contents.autopilot]}")
    found: AutopilotNames = table.names(contents)
    return found
