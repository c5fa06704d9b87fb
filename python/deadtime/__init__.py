"""Control loops with a delay in them."""

from deadtime._controllers import PD, PI, PID, PV, DerivativeFilter, P
from deadtime._loop import ControlLoop
from deadtime._plants import FirstOrder, Integrator, RationalPlant, kit_plant
from deadtime._quasipolynomial import QuasiPolynomial, delay, s
from deadtime._response import Response
from deadtime._rootset import RootSet

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
    "QuasiPolynomial",
    "RationalPlant",
    "Response",
    "RootSet",
    "delay",
    "kit_plant",
    "s",
]
