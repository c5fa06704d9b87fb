"""An emulated AR.Drone 2.0: its wire protocol, its states and a choice of plants.

`Emulator` listens on sockets; `Drone` is the emulation without them.
"""

from deadtime.links.ardrone2.emulator.drone import Drone, Truth
from deadtime.links.ardrone2.emulator.flight import Phase
from deadtime.links.ardrone2.emulator.options import EmulatorOptions
from deadtime.links.ardrone2.emulator.server import Emulator
from deadtime.links.ardrone2.emulator.thrust import Thruster, ThrustMotion

__all__ = [
    "Drone",
    "Emulator",
    "EmulatorOptions",
    "Phase",
    "ThrustMotion",
    "Thruster",
    "Truth",
]
