"""A loop as the explorer takes it: plain numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from deadtime._base.explorer import Explorer
from deadtime.loops._factored_plant import FactoredPlant
from deadtime.loops._plants import FirstOrder, Integrator, Plant
from deadtime.loops._specification import LoopSpecification, is_unequal, refuse_discretised

#: Gains on the axes reach to so many times the loop's own.
_REACH = 4.0

#: Gains of an axis where the loop has none.
_GAINS = 1.0


def explorer_of(
    loop: LoopSpecification,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    interval: tuple[float, float] | None = None,
) -> Explorer:
    """The explorer of a loop, its map over these ranges, with the interval of its delay."""
    state = described(loop)
    if ranges is None:
        ranges = _ranges(loop)
    for axis, (name, (low, high)) in zip("xy", ranges.items(), strict=True):
        state |= {axis: name, f"{axis}_range": [float(low), float(high)]}
    if interval is not None and all(map(math.isfinite, interval)):
        state["interval"] = [float(end) for end in interval]
    return Explorer(state)


def described(loop: LoopSpecification) -> dict[str, Any]:
    """The numbers of a loop by the names of the explorer; raises where that has no such loop."""
    controller, plant = loop.controller, _simplest(loop.plant)
    if not plant.is_rational or not plant.is_linear:
        raise ValueError(
            f"the explorer cannot show a {type(plant).__name__}. It shows linear plants that "
            "are rational except for one delay in series. Make a loop with such a plant"
        )
    refuse_discretised(controller, loop.sample_time, "the explorer")
    known = type(controller).__name__
    shown = {"weight", "tracking_time"} if known in ("PI", "PID") else set()
    if loop.rate_limit is not None or not shown.issuperset(controller._extras):
        raise ValueError(
            "the explorer cannot show a rate limit, a feed-forward or a weight of the "
            "derivative: leave them out"
        )
    if known not in ("P", "PI", "PD", "PV", "PID"):
        raise ValueError(
            f"the explorer cannot show {known}. It shows P, PI, PD, PV and PID controllers"
        )
    low, high = loop.bounds
    if is_unequal(loop.limit) and not 0.0 < high < math.inf > -low:
        raise ValueError(
            f"limit={loop.limit!r}: the explorer needs two finite limits, the greater one "
            "above zero"
        )
    state: dict[str, Any] = {
        "controller": known,
        "delay": loop.known_delay,
        "sample_time": loop.sample_time or 0.0,
        "limit": high if loop.limit else 0.0,
        "delay_path": loop.delay_path,
        **controller.gains,
        **controller._extras,
    }
    if is_unequal(loop.limit):
        state["low"] = low
    form = controller._form
    if form.stops or "tracking_time" in state:
        state["guard"] = "stops" if form.stops else "tracking"
    smooth = controller._filter
    if smooth is not None:
        state |= {"filter": True, "omega": smooth.omega, "damping": smooth.damping}
    if isinstance(plant, Integrator):
        return state | {"plant": "integrator", "gain": plant.gain, "lag": plant.lag}
    if isinstance(plant, FirstOrder) and plant.time_constant > 0.0:
        return state | {"plant": "first_order", "gain": plant.gain, "lag": plant.time_constant}
    gain = plant.parameters.get("gain", 1.0)
    num, den = plant.polynomials()
    return state | {
        "plant": "rational",
        "gain": gain,
        "lag": 0.0,
        "num": np.asarray(num / gain).tolist(),
        "den": np.asarray(den).tolist(),
    }


def _simplest(plant: Plant) -> Plant:
    """An integrator or a lag for a plant of factors that is one, since these have a slider."""
    if not isinstance(plant, FactoredPlant) or len(plant.lags) != 1 or plant.has_pair or plant.zero:
        return plant
    return (Integrator if plant.integrator else FirstOrder)(plant.gain, plant.lags[0])


def _ranges(loop: LoopSpecification) -> dict[str, tuple[float, float]]:
    """Two axes: the first two gains, or the gain and the delay."""
    gains = loop.controller.gains
    ranges = {name: _around(value) for name, value in list(gains.items())[:2]}
    if len(ranges) < 2:
        ranges["delay"] = (0.0, 2.0 * loop.known_delay or 1.0)
    return ranges


def _around(gain: float) -> tuple[float, float]:
    reach = float(f"{_REACH * abs(gain):.1g}") or _GAINS
    return (0.0, reach) if gain > 0.0 else (-reach, reach)
