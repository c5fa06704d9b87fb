"""Control loops with a delay in them.

The delay of a recorded loop with its uncertainty, the characteristic roots of time-delay systems,
maps of the gains that are stable, and exact simulation with hold and limit.
"""

from deadtime._certificate import Certificate
from deadtime._controllers import PD, PI, PID, PV, Controller, DerivativeFilter, P
from deadtime._design import Design, design
from deadtime._errors import (
    CertificateError,
    ContourError,
    ConvergenceError,
    CountMismatchError,
    DeadtimeError,
    NotIdentifiableError,
    RecordingError,
)
from deadtime._estimation import (
    CramerRaoBound,
    DelayEstimate,
    Whiteness,
    damping_ratio,
    estimate_delay,
)
from deadtime._loop import ControlLoop
from deadtime._parametric import Parameter, ParametricQuasiPolynomial, parameters
from deadtime._plants import FirstOrder, Integrator, Plant, RationalPlant, kit_plant
from deadtime._quasipolynomial import QuasiPolynomial, delay, s
from deadtime._readers import read_recording
from deadtime._recording import Recording, Step
from deadtime._response import Response
from deadtime._rootset import RootSet
from deadtime._special import dde_roots, lambertw
from deadtime._stability import MapStatus, StabilityMap, stability_map

__all__ = [
    "PD",
    "PI",
    "PID",
    "PV",
    "Certificate",
    "CertificateError",
    "ContourError",
    "ControlLoop",
    "Controller",
    "ConvergenceError",
    "CountMismatchError",
    "CramerRaoBound",
    "DeadtimeError",
    "DelayEstimate",
    "DerivativeFilter",
    "Design",
    "FirstOrder",
    "Integrator",
    "MapStatus",
    "NotIdentifiableError",
    "P",
    "Parameter",
    "ParametricQuasiPolynomial",
    "Plant",
    "QuasiPolynomial",
    "RationalPlant",
    "Recording",
    "RecordingError",
    "Response",
    "RootSet",
    "StabilityMap",
    "Step",
    "Whiteness",
    "damping_ratio",
    "dde_roots",
    "delay",
    "design",
    "estimate_delay",
    "kit_plant",
    "lambertw",
    "parameters",
    "read_recording",
    "s",
    "stability_map",
]
