"""Links to vehicles and to the other end of a loop, on asyncio.

What all links share: the protocol of a vehicle, the checks of a command before it is sent, the
rules that end a flight, recordings that are written during a run, and a virtual clock that advances
from event to event, for tests and simulated experiments. Each vehicle has a package of its own.
"""

from deadtime.links.axes import AXES, Axis, AxisReader
from deadtime.links.clock import now
from deadtime.links.journal import Journal
from deadtime.links.landing import run_landing, terminated_like_interrupted
from deadtime.links.safety import Limits, UnitCommand, Watch, largest_gain
from deadtime.links.vehicle import Motion, Vehicle, VehicleState
from deadtime.links.virtual_time import run

__all__ = [
    "AXES",
    "Axis",
    "AxisReader",
    "Journal",
    "Limits",
    "Motion",
    "UnitCommand",
    "Vehicle",
    "VehicleState",
    "Watch",
    "largest_gain",
    "now",
    "run",
    "run_landing",
    "terminated_like_interrupted",
]
