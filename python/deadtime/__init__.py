"""Control loops with a delay in them.

The delay of a recorded loop with its uncertainty, the characteristic roots of time-delay systems,
maps of the gains that are stable, and exact simulation with hold and limit.
"""

from deadtime._controllers import PD, PI, PID, PV, Controller, DerivativeFilter, P

from deadtime._errors import (
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
from deadtime._plants import FirstOrder, Integrator, Plant, RationalPlant, kit_plant
from deadtime._quasipolynomial import QuasiPolynomial, delay, s
from deadtime._readers import read_recording
from deadtime._recording import Recording, Step
from deadtime._response import Response
from deadtime._rootset import RootSet
from deadtime._special import dde_roots, lambertw

__all__ = [
    "PD",
    "PI",
    "PID",
    "PV",
    "ContourError",
    "ControlLoop",
    "Controller",
    "ConvergenceError",
    "CountMismatchError",
    "CramerRaoBound",
    "DeadtimeError",
    "DelayEstimate",
    "DerivativeFilter",
    #    "Design",
    "FirstOrder",
    "Integrator",
    "NotIdentifiableError",
    "P",
    "Plant",
    "QuasiPolynomial",
    "RationalPlant",
    "Recording",
    "RecordingError",
    "Response",
    "RootSet",
    "Step",
    "Whiteness",
    "damping_ratio",
    "dde_roots",
    #    "delay",
    "estimate_delay",
    "kit_plant",
    "lambertw",
    "read_recording",
    "s",
]
