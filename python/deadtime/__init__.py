"""Control loops with a delay in them.

The delay of a recorded loop with its uncertainty, the characteristic roots of time-delay systems,
maps of the gains that are stable, and exact simulation with hold and limit.
"""

from deadtime import gallery
from deadtime._boxes import ProvedBoxes, largest_stable_box, proved_boxes
from deadtime._certificate import Certificate
from deadtime._chains import Chain
from deadtime._controllers import PD, PI, PID, PV, Controller, P
from deadtime._crossings import Crossings, crossings, delay_margin
from deadtime._delay_solution import DelayResult, DelaySolution
from deadtime._derivative_filter import DerivativeFilter
from deadtime._design import Design, FilterChoice, LeastMargins, Trade, design, design_filter
from deadtime._errors import (
    CertificateError,
    ContourError,
    ConvergenceError,
    CountMismatchError,
    DeadtimeError,
    FlightAbortedError,
    LinkError,
    MissingExtraError,
    NotIdentifiableError,
    PacketError,
    RecordingError,
    WorkerError,
)
from deadtime._estimation import (
    CramerRaoBound,
    DelayEstimate,
    Flight,
    Identifiability,
    MonteCarlo,
    PlannedBound,
    Whiteness,
    damping_ratio,
    estimate_delay,
    identifiability,
)
from deadtime._excitation import Experiment
from deadtime._expansion import Expansion
from deadtime._fixed_step import simulate_fixed_step
from deadtime._loop import ControlLoop
from deadtime._low_level import low_level_callable
from deadtime._margins import Margins
from deadtime._parametric import Parameter, ParametricQuasiPolynomial, parameters
from deadtime._plants import FirstOrder, Integrator, Plant, RationalPlant, kit_plant
from deadtime._quasipolynomial import QuasiPolynomial, delay, s
from deadtime._readers import read_recording
from deadtime._recording import Recording, Step
from deadtime._response import Response
from deadtime._robust import RobustMap, robust_map
from deadtime._rootset import RootSet
from deadtime._scalar_delay import dde_roots, rightmost_branches
from deadtime._sensitivity import Sensitivity
from deadtime._simulation import simulate
from deadtime._solve_dde import solve_dde
from deadtime._special import lambertw, lambertw0, lambertwm1
from deadtime._special_forms import (
    OffsetW,
    lambertw_derivative,
    lambertw_log,
    lambertw_offset,
    wrightomega,
)
from deadtime._stability import MapStatus, StabilityMap, stability_map
from deadtime._stability_radius import StabilityRadius, stability_radius
from deadtime._sweep import Sweep, SweepStatus, sweep
from deadtime._system_response import SystemResponse
from deadtime._systems import DelaySystem
from deadtime._transfer import TransferFunction, feedback

__all__ = [
    "PD",
    "PI",
    "PID",
    "PV",
    "Certificate",
    "CertificateError",
    "Chain",
    "ContourError",
    "ControlLoop",
    "Controller",
    "ConvergenceError",
    "CountMismatchError",
    "CramerRaoBound",
    "Crossings",
    "DeadtimeError",
    "DelayEstimate",
    "DelayResult",
    "DelaySolution",
    "DelaySystem",
    "DerivativeFilter",
    "Design",
    "Expansion",
    "Experiment",
    "FilterChoice",
    "FirstOrder",
    "Flight",
    "FlightAbortedError",
    "Identifiability",
    "Integrator",
    "LeastMargins",
    "LinkError",
    "MapStatus",
    "Margins",
    "MissingExtraError",
    "MonteCarlo",
    "NotIdentifiableError",
    "OffsetW",
    "P",
    "PacketError",
    "Parameter",
    "ParametricQuasiPolynomial",
    "PlannedBound",
    "Plant",
    "ProvedBoxes",
    "QuasiPolynomial",
    "RationalPlant",
    "Recording",
    "RecordingError",
    "Response",
    "RobustMap",
    "RootSet",
    "Sensitivity",
    "StabilityMap",
    "StabilityRadius",
    "Step",
    "Sweep",
    "SweepStatus",
    "SystemResponse",
    "Trade",
    "TransferFunction",
    "Whiteness",
    "WorkerError",
    "crossings",
    "damping_ratio",
    "dde_roots",
    "delay",
    "delay_margin",
    "design",
    "design_filter",
    "estimate_delay",
    "feedback",
    "gallery",
    "identifiability",
    "kit_plant",
    "lambertw",
    "lambertw0",
    "lambertw_derivative",
    "lambertw_log",
    "lambertw_offset",
    "lambertwm1",
    "largest_stable_box",
    "low_level_callable",
    "parameters",
    "proved_boxes",
    "read_recording",
    "rightmost_branches",
    "robust_map",
    "s",
    "simulate",
    "simulate_fixed_step",
    "solve_dde",
    "stability_map",
    "stability_radius",
    "sweep",
    "wrightomega",
]
