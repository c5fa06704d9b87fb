"""Control loops with a delay in them."""

from deadtime._controllers import PD, PI, PID, PV, DerivativeFilter, P
from deadtime._loop import ControlLoop
from deadtime._parametric import Parameter, ParametricQuasiPolynomial, parameters
from deadtime._plants import FirstOrder, Integrator, RationalPlant, kit_plant
from deadtime._quasipolynomial import QuasiPolynomial, delay, s
from deadtime._response import Response
from deadtime._rootset import RootSet
from deadtime._stability import MapStatus, StabilityMap, stability_map

__all__ = [
    "PD",
    "PI",
    "PID",
    "PV",
    "ControlLoop",
    "DerivativeFilter",
    "FirstOrder",
    "Integrator",
    "MapStatus",
    "P",
    "Parameter",
    "ParametricQuasiPolynomial",
    "QuasiPolynomial",
    "RationalPlant",
    "Response",
    "RootSet",
    "StabilityMap",
    "delay",
    "kit_plant",
    "parameters",
    "s",
    "stability_map",
]
