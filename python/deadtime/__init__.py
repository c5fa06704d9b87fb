"""Control loops with a delay in them."""

from deadtime._controllers import PD, PI, PID, PV, DerivativeFilter, P
from deadtime._loop import ControlLoop
from deadtime._plants import FirstOrder, Integrator, RationalPlant, kit_plant
from deadtime._response import Response

__all__ = [
    "PD",
    "PI",
    "PID",
    "PV",
    "ControlLoop",
    "DerivativeFilter",
    "FirstOrder",
    "Integrator",
    "P",
    "RationalPlant",
    "Response",
    "kit_plant",
]
