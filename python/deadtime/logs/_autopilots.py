"""The tables of the autopilots; each is imported when a log of it is opened."""

from __future__ import annotations

import importlib

from deadtime.logs._contents import LogContents
from deadtime.logs._names import AutopilotNames

#: The file with the function ``names(contents) -> AutopilotNames`` of each autopilot.
TABLES = {
    "PX4": "_px4",
    "ArduPilot": "_ardupilot",
    "Betaflight": "_betaflight",
    "Cleanflight": "_betaflight",
    "INAV": "_betaflight",
    "Crazyflie": "_crazyflie_loops",
}


def names_of(contents: LogContents) -> AutopilotNames:
    """The loops that logs of this autopilot can hold; none of an unknown one."""
    found = AutopilotNames(())
    if contents.autopilot in TABLES:
        table = importlib.import_module(f"deadtime.logs.{TABLES[contents.autopilot]}")
        found = table.names(contents)
    if contents.format == "tlog":  # the messages are the same for all autopilots
        from deadtime.logs._mavlink import LOOPS

        return AutopilotNames(LOOPS, found.key_parameters)
    if contents.format == "sdlog2":
        from deadtime.logs._sdlog2 import sdlog2_names

        return sdlog2_names(found)
    return found
