"""Links to vehicles and to the other end of a loop, on asyncio.

What every link shares is here: the protocol of a vehicle, what must hold for a command before it
leaves, the rules that end a flight, recordings that are saved as they come, and a clock that jumps
from event to event, for tests and for experiments in seconds. Each vehicle has a package beside it.
"""

from deadtime.links.clock import now
from deadtime.links.journal import Journal
from deadtime.links.safety import Limits, UnitCommand, Watch, largest_gain
from deadtime.links.vehicle import Vehicle, VehicleState
from deadtime.links.virtual_time import run

__all__ = [
    "Journal",
    "Limits",
    "UnitCommand",
    "Vehicle",
    "VehicleState",
    "Watch",
    "largest_gain",
    "now",
    "run",
]
