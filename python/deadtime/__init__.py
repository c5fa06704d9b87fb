"""Control loops with a delay.

The delay of a recorded loop with its uncertainty, the characteristic roots of time-delay systems,
maps of the gains that are stable, and exact simulation with hold and limit.

This is the table of contents: what people call and construct. Each name belongs to a package
inside of this one, which is loaded when it is first used and has results and further functions.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deadtime._base.errors import (
        CertificateError,
        ContourError,
        ConvergenceError,
        CountMismatchError,
        DeadtimeError,
        FlightAbortedError,
        LinkError,
        MissingExtraError,
        NotIdentifiableError,
        NotProvedError,
        PacketError,
        RecordingError,
        WorkerError,
    )
    from deadtime.dde import solve_dde
    from deadtime.estimation import damping_ratio, estimate_delay, identifiability
    from deadtime.experiments import Experiment
    from deadtime.logs import latency, open_log
    from deadtime.loops import (
        PD,
        PI,
        PID,
        PV,
        ControlLoop,
        DerivativeFilter,
        FactoredPlant,
        FirstOrder,
        Integrator,
        P,
        ParametricPlant,
        RateLimited,
        RationalPlant,
        kit_plant,
        simulate_fixed_step,
        sweep,
    )
    from deadtime.recordings import Recording, read_recording
    from deadtime.roots import (
        QuasiPolynomial,
        crossings,
        dde_roots,
        delay,
        delay_margin,
        parameters,
        s,
    )
    from deadtime.special import lambertw, lambertw0, lambertwm1, wrightomega
    from deadtime.stability import (
        largest_stable_box,
        proved_boxes,
        robust_map,
        stability_map,
        stability_radius,
    )
    from deadtime.systems import DelaySystem, TransferFunction, feedback
    from deadtime.tuning import design, design_filter

#: The names of each package that are here too.
_PACKAGES = {
    "_base.errors": (
        "CertificateError ContourError ConvergenceError CountMismatchError DeadtimeError "
        "FlightAbortedError LinkError MissingExtraError NotIdentifiableError NotProvedError "
        "PacketError RecordingError WorkerError"
    ),
    "special": "lambertw lambertw0 lambertwm1 wrightomega",
    "dde": "solve_dde",
    "roots": "QuasiPolynomial crossings dde_roots delay delay_margin parameters s",
    "systems": "DelaySystem TransferFunction feedback",
    "loops": (
        "ControlLoop DerivativeFilter FactoredPlant FirstOrder Integrator P PD PI PID PV "
        "ParametricPlant RateLimited RationalPlant kit_plant simulate_fixed_step sweep"
    ),
    "stability": "largest_stable_box proved_boxes robust_map stability_map stability_radius",
    "recordings": "Recording read_recording",
    "experiments": "Experiment",
    "gallery": "",
    "links": "",
    "estimation": "damping_ratio estimate_delay identifiability",
    "tuning": "design design_filter",
    "reports": "",
    "logs": "latency open_log",
    "flights": "",
    "internet": "",
    "paper": "",
}
#: Version of the installed package.
__version__: str

_PACKAGE_OF = {name: package for package, names in _PACKAGES.items() for name in names.split()}

__all__ = [
    "PD",
    "PI",
    "PID",
    "PV",
    "CertificateError",
    "ContourError",
    "ControlLoop",
    "ConvergenceError",
    "CountMismatchError",
    "DeadtimeError",
    "DelaySystem",
    "DerivativeFilter",
    "Experiment",
    "FactoredPlant",
    "FirstOrder",
    "FlightAbortedError",
    "Integrator",
    "LinkError",
    "MissingExtraError",
    "NotIdentifiableError",
    "NotProvedError",
    "P",
    "PacketError",
    "ParametricPlant",
    "QuasiPolynomial",
    "RateLimited",
    "RationalPlant",
    "Recording",
    "RecordingError",
    "TransferFunction",
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
    "identifiability",
    "kit_plant",
    "lambertw",
    "lambertw0",
    "lambertwm1",
    "largest_stable_box",
    "latency",
    "open_log",
    "parameters",
    "proved_boxes",
    "read_recording",
    "robust_map",
    "s",
    "simulate_fixed_step",
    "solve_dde",
    "stability_map",
    "stability_radius",
    "sweep",
    "wrightomega",
]

if not TYPE_CHECKING:  # A type checker reads the imports above.

    def __getattr__(name: str) -> Any:
        """Load the package of a name when the name is first used."""
        if name in _PACKAGE_OF:
            value = getattr(importlib.import_module(f"deadtime.{_PACKAGE_OF[name]}"), name)
        elif name == "__version__":
            value = importlib.import_module("importlib.metadata").version("deadtime")
        elif name in _PACKAGES and not name.startswith("_"):
            value = importlib.import_module(f"deadtime.{name}")
        else:
            raise AttributeError(f"module 'deadtime' has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return [*__all__, *(package for package in _PACKAGES if not package.startswith("_"))]
