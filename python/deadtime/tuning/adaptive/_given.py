"""What `adaptive_gains` was given: checked, and put as claims that have no form yet."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from deadtime._base.validation import interval
from deadtime.estimation import DelayEstimate
from deadtime.loops import PV, ControlLoop, P
from deadtime.tuning._result import Design
from deadtime.tuning.adaptive._claims import Claims, FilterNumbers


def loop_and_gain(
    loop: Any, gain: tuple[float, float] | None, level: float
) -> tuple[ControlLoop, tuple[float, float]]:
    """The loop that was given, and the interval of its plant's gain."""
    held = loop.loop if isinstance(loop, (DelayEstimate, Design)) else loop
    if not isinstance(held, ControlLoop):
        raise TypeError(
            f"loop={loop!r}: give a ControlLoop, or an estimate or a design of such a loop"
        )
    if gain is not None:
        low, high = interval("gain", gain, may_be_point=True)
    elif isinstance(loop, DelayEstimate) and "gain" in loop.free:
        low, high = loop.ci(level, "gain")
    elif isinstance(loop, Design) and loop.gain is not None:
        low, high = loop.gain
    else:
        low = high = held.plant.parameters.get("gain", math.nan)
    if not low * high > 0.0:
        raise ValueError(
            f"gain={(low, high)!r}: give an interval (low, high) of gains, both positive or both "
            "negative"
        )
    return held, (float(low), float(high))


def sample_time_of(loop: ControlLoop) -> float:
    if loop.sample_time is None:
        raise ValueError(
            "sample_time=None: the proof needs a controller that runs on samples. Give a "
            "sample_time"
        )
    if loop.delay_path != "command":
        raise ValueError(
            f"delay_path={loop.delay_path!r}: the proof is for a changing delay of the command. "
            "Give the loop with delay_path='command'"
        )
    return loop.sample_time


def claimed(loop: ControlLoop, gain: tuple[float, float], decay: float) -> Claims:
    """What can be claimed of this loop, without sets."""
    controller, plant = loop.controller, loop.plant
    if not isinstance(controller, (P, PV)):
        raise ValueError(
            f"{type(controller).__name__}: gains can follow the delay only in P and PV, because "
            "only these controllers have no state that depends on earlier gains"
        )
    if not plant.is_linear or not plant.is_rational:
        raise ValueError(
            f"{type(plant).__name__}: the proof needs a plant that is rational except for the delay"
        )
    num, den = plant._polynomials({**plant.parameters, "gain": 1.0})
    while den[0] == 0.0:
        den = den[1:]
    num = list(np.trim_zeros(num, "f"))
    if len(den) not in (2, 3) or den[-1] != 0.0 or den[-2] == 0.0 or len(num) >= len(den):
        raise ValueError(
            f"{plant!r}: the proof is for an integrator with at most one lag and a zero. "
            "Replace several lags by one lag that is their sum"
        )
    Kp, Kv = controller.gains["Kp"], controller.gains.get("Kv", 0.0)
    smooth = getattr(controller, "filter", None)
    if smooth is None and Kv != 0.0 and (len(den) == 2 or len(num) > 1):
        raise ValueError(
            "the velocity of this plant jumps with its command. Give the controller a filter, "
            "such as DerivativeFilter(38.0, discretisation='tustin')"
        )
    if smooth is not None and Kv != 0.0 and smooth.discretisation not in ("tustin", "backward"):
        raise ValueError(
            f"discretisation={smooth.discretisation!r}: the proof needs a filter that runs on "
            "samples. Give DerivativeFilter(..., discretisation='tustin') or 'backward'"
        )
    numbers: FilterNumbers | None = None
    if smooth is not None and Kv != 0.0:
        numbers = (smooth.omega, smooth.damping, smooth.discretisation)
    return Claims(
        num=tuple(map(float, num)),
        den=tuple(map(float, den)),
        gain=gain,
        sample_time=sample_time_of(loop),
        Kp=Kp,
        Kv=Kv,
        filter=numbers,
        factors=(),
        ages=(),
        limit=loop.limit,
        least_factor=1.0,
        decay=decay,
        step=0.0,
        form=(),
    )
