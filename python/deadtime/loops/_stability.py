"""Stable ranges of the numbers of a loop, limit left out."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

import deadtime.loops._native as native
from deadtime.loops._characteristic import characteristic
from deadtime.loops._controllers import Controller
from deadtime.loops._factored_plant import PAIR
from deadtime.loops._model import LoopModel
from deadtime.loops._parametric_plant import ParametricPlant
from deadtime.loops._plants import Plant
from deadtime.roots import Parameter, QuasiPolynomial

#: Numbers of a loop that cannot be negative.
_NON_NEGATIVE = frozenset({"delay", "lag", "sample_time", "omega", "damping"}) | {
    f"lag_{i}" for i in range(1, 10)
}
#: Numbers that keep their sign, since the loop has no meaning at zero.
_KEEPS_SIGN = frozenset({"time_constant", *PAIR})
#: Numbers of a filter.
_OF_FILTER = frozenset({"omega", "damping"})


def continuous_range(
    plant: Plant, controller: Controller, values: Mapping[str, float], name: str
) -> tuple[float, float]:
    """Stable values of one number of a continuous loop, around its present one."""
    value = values[name]
    family = characteristic(plant, controller, {**values, name: Parameter(name)})
    if name == "delay":
        return native.delay_range(family._family, value)
    if name in _OF_FILTER:
        seek = native.damping_range if name == "damping" else native.corner_range
        return seek(family._family, value, _highest_crossing(plant, controller, values))
    return native.gain_range(family._family, value, _bounds(plant, name, value))


def _highest_crossing(plant: Plant, controller: Controller, values: Mapping[str, float]) -> float:
    """A frequency beyond which the loop gain is below one; infinite where there is none.

    Whatever the corner of its filter is, and for all dampings from the present one on.
    """
    b, a = plant._polynomials(values)
    terms, damping = controller._terms(values), values["damping"]
    # The least modulus of x^2 + 2 damping x + 1 where Re x >= 0.
    least = 1.0 if damping >= math.sqrt(0.5) else 2.0 * damping * math.sqrt(1.0 - damping * damping)
    feedback = [abs(terms.derivative) / least, abs(terms.proportional), abs(terms.integral)]
    gain = np.polymul(np.abs(b), feedback)[::-1]
    rest = np.append(0.0, np.asarray(a, dtype=np.float64)[::-1])
    return native.end_of_gain(
        QuasiPolynomial([gain], [0.0])._native, QuasiPolynomial([rest], [0.0])._native, 1.0
    )


def sampled_range(
    plant: Plant, controller: Controller, values: Mapping[str, float], name: str
) -> tuple[float, float]:
    """Stable values of one number of a sampled loop, around its present one."""
    value, bounds = values[name], _bounds(plant, name, values[name])

    def loop(**changed: float) -> native.LinearLoop:
        given = {**values, **changed}
        model = LoopModel.build(plant, controller, given)
        return model.native(given["delay"], given["sample_time"])

    def at(changed: float) -> native.LinearLoop:
        return loop(**{name: changed})

    if name == "delay":
        return at(value).held_delay_range()
    gains = controller._gains()
    if name == "gain" or name in gains:
        # The feedback is linear in the gains of the controller times the gain of the plant.
        total = {gain: values[gain] * (values["gain"] if name != "gain" else 1.0) for gain in gains}
        none = dict.fromkeys(gains, 0.0)
        own = total if name == "gain" else {**none, name: values["gain"]}
        rest = none if name == "gain" else {**total, name: 0.0}
        return loop(gain=1.0, **rest).held_gain_range(loop(gain=1.0, **own), value, bounds)
    return native.LinearLoop.held_range(at, name, value, bounds)


def _bounds(plant: Plant, name: str, value: float) -> tuple[float, float]:
    """Between what a number can be."""
    own = isinstance(plant, ParametricPlant) and name in plant.numbers
    keeps_sign = (own or name in _KEEPS_SIGN) and value != 0.0
    if keeps_sign and value < 0.0:
        return -math.inf, 0.0
    return (0.0 if name in _NON_NEGATIVE or keeps_sign else -math.inf), math.inf
