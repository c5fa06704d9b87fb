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
        CertificateError as CertificateError,
        ContourError as ContourError,
        ConvergenceError as ConvergenceError,
        CountMismatchError as CountMismatchError,
        DeadtimeError as DeadtimeError,
        FlightAbortedError as FlightAbortedError,
        LinkError as LinkError,
        MissingExtraError as MissingExtraError,
        NotIdentifiableError as NotIdentifiableError,
        NotProvedError as NotProvedError,
        PacketError as PacketError,
        RecordingError as RecordingError,
        WorkerError as WorkerError,
    )
    from deadtime.dde import solve_dde as solve_dde
    from deadtime.estimation import (
        damping_ratio as damping_ratio,
        estimate_delay as estimate_delay,
        identifiability as identifiability,
    )
    from deadtime.experiments import Experiment as Experiment
    from deadtime.logs import latency as latency, open_log as open_log
    from deadtime.loops import (
        PD as PD,
        PI as PI,
        PID as PID,
        PV as PV,
        ControlLoop as ControlLoop,
        DerivativeFilter as DerivativeFilter,
        FactoredPlant as FactoredPlant,
        FirstOrder as FirstOrder,
        Integrator as Integrator,
        P as P,
        ParametricPlant as ParametricPlant,
        RateLimited as RateLimited,
        RationalPlant as RationalPlant,
        kit_plant as kit_plant,
        simulate_fixed_step as simulate_fixed_step,
        sweep as sweep,
    )
    from deadtime.recordings import Recording as Recording, read_recording as read_recording
    from deadtime.roots import (
        QuasiPolynomial as QuasiPolynomial,
        crossings as crossings,
        dde_roots as dde_roots,
        delay as delay,
        delay_margin as delay_margin,
        parameters as parameters,
        s as s,
    )
    from deadtime.special import (
        lambertw as lambertw,
        lambertw0 as lambertw0,
        lambertwm1 as lambertwm1,
        wrightomega as wrightomega,
    )
    from deadtime.stability import (
        largest_stable_box as largest_stable_box,
        proved_boxes as proved_boxes,
        robust_map as robust_map,
        stability_map as stability_map,
        stability_radius as stability_radius,
    )
    from deadtime.systems import (
        DelaySystem as DelaySystem,
        TransferFunction as TransferFunction,
        feedback as feedback,
    )
    from deadtime.tuning import (
        check_gains as check_gains,
        design as design,
        design_filter as design_filter,
        tune as tune,
    )


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
    "tuning": "check_gains design design_filter tune",
    "reports": "",
    "logs": "latency open_log",
    "flights": "",
    "internet": "",
    "paper": "",
}
#: Version of the installed package.
__version__: str

#: Names that other packages have, and how the same is written here.
_ELSEWHERE = {
    "bode": "G.bode(), with G a TransferFunction or ControlLoop",
    "bode_plot": "G.bode()",
    "exp": "delay(T) for exp(-T s)",
    "freqresp": "G.frequency_response(omega)",
    "impulse_response": "G.impulse_response(duration)",
    "margin": "G.margin(), with the loop gain G, or loop.margin() of a ControlLoop",
    "nyquist": "G.nyquist()",
    "nyquist_plot": "G.nyquist()",
    "pade": (
        "G.to_control(pade=n) or G.to_scipy(pade=n); deadtime itself never approximates a delay"
    ),
    "poles": "G.rightmost(n), or G.poles(re, im) for a region",
    "root_locus": "crossings(family, ranges), or loop.explore()",
    "ss": "DelaySystem(A, B, C, D)",
    "step": "G.step_response()",
    "step_response": "G.step_response()",
    "tf": "TransferFunction(num, den, delay=T), or an expression in s and delay(T)",
}

_PACKAGE_OF = {name: package for package, names in _PACKAGES.items() for name in names.split()}

__all__ = sorted(_PACKAGE_OF)

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
            here = f": write {_ELSEWHERE[name]}" if name in _ELSEWHERE else ""
            raise AttributeError(f"module 'deadtime' has no attribute {name!r}{here}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return [*__all__, *(package for package in _PACKAGES if not package.startswith("_"))]
