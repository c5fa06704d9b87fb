"""Characteristic function and transfer functions of a continuous loop, its limit left out.

With the plant b/a, the feedback F = f/g and the reference path R = r/g of the controller, the loop
has the characteristic function a g + b f e^(-s delay).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from deadtime.loops._controllers import Controller
from deadtime.loops._plants import Plant, in_s
from deadtime.roots import Parameter, ParametricQuasiPolynomial, delay
from deadtime.systems import TransferFunction


def characteristic(plant: Plant, controller: Controller, values: Mapping[str, Any]) -> Any:
    """Build a g + b f e^(-s delay) from numbers or symbols in `values`."""
    b, a = plant._fraction(values)
    f, g = map(in_s, controller._feedback(values))
    return a * g + b * f * delay(values["delay"])


def open_loop(
    plant: Plant, controller: Controller, values: Mapping[str, float]
) -> TransferFunction:
    """Build b f e^(-s delay) / (a g)."""
    b, a = plant._fraction(values)
    f, g = map(in_s, controller._feedback(values))
    return TransferFunction(b * f * delay(values["delay"]), a * g)


def closed_loop(
    plant: Plant, controller: Controller, values: Mapping[str, float], delay_path: str
) -> TransferFunction:
    """Build b r [e^(-s delay)] / (a g + b f e^(-s delay)), delayed where the command is."""
    b, _ = plant._fraction(values)
    num = b * in_s(controller._reference(values)[0])
    if delay_path == "command":
        num = num * delay(values["delay"])
    return TransferFunction(num, characteristic(plant, controller, values))


def reference_to_command(
    plant: Plant, controller: Controller, values: Mapping[str, float]
) -> TransferFunction:
    """Build a r / (a g + b f e^(-s delay))."""
    _, a = plant._fraction(values)
    num = a * in_s(controller._reference(values)[0])
    return TransferFunction(num, characteristic(plant, controller, values))


def family_of_loop(
    characteristic: Callable[[Mapping[str, Any]], Any],
    parameters: Mapping[str, float | None],
    names: Collection[str],
) -> ParametricQuasiPolynomial:
    """Return `characteristic` with the parameters `names`; the others keep their values."""
    values = numbers_of(parameters, names)
    values |= {name: Parameter(name) for name in names}
    family = characteristic(values)
    # Stability need not depend on every number of the loop.
    idle = tuple(name for name in names if name not in family.names)
    return ParametricQuasiPolynomial._of((*family.names, *idle), family._terms)


def numbers_of(parameters: Mapping[str, float | None], names: Collection[str]) -> dict[str, Any]:
    """Return the numbers of a loop that stability depends on; `names` must be among them."""
    values: dict[str, Any] = {**parameters}
    values.pop("limit", None)
    unknown = [name for name in names if name not in values and name != "delay"]
    if unknown:
        raise ValueError(
            f"ranges for {', '.join(unknown)}: stability depends on no such number of this loop, "
            f"but on {', '.join(dict.fromkeys([*values, 'delay']))}"
        )
    if "delay" not in values and "delay" not in names:
        raise ValueError(
            "the delay of this loop is None: give it a range, or set it with "
            "loop.replace(delay=...)"
        )
    return values
