"""Gains for all plants that an estimate leaves possible, and whether they may be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import copysign, isfinite
from typing import Any

from deadtime.estimation import PlantEstimate
from deadtime.loops import Controller, ControlLoop
from deadtime.tuning._design import design
from deadtime.tuning._found_plants import possible_loops
from deadtime.tuning._gate import LARGEST_CHANGE, LARGEST_SENSITIVITY, check_gains
from deadtime.tuning._result import Design

#: Least gain of an integrating plant that is tried, as a share of the largest. Larger: slow
#: integrals are left out; smaller: their responses take long to come to rest.
LEAST = 2e-3

#: Largest relative change of Ms by that of a gain: at an Ms of 3 it is about twice the latter.
ROUNDED = 3.0

#: Change of a gain, as a share, that is not worth a sentence.
SAME = 1e-3


@dataclass(frozen=True)
class Gains:
    """Gains for an estimate.

    Attributes
    ----------
    design : Design
        As it was found.
    controller : Controller
        With at most `LARGEST_CHANGE` times the gains that were flown.
    loops : tuple of ControlLoop
        The loops that the estimate leaves possible, the likeliest first.
    remarks : tuple of str
        What else has to be known.
    """

    design: Design
    controller: Controller
    loops: tuple[ControlLoop, ...]
    remarks: tuple[str, ...]

    def under(self, controller: Controller) -> tuple[ControlLoop, ...]:
        """The loops under a controller."""
        return tuple(loop.replace(controller=controller) for loop in self.loops)


def why_none(fit: PlantEstimate, level: float, allow_indication: bool) -> tuple[str, ...]:
    """Why no gains come of an estimate, whatever they are; empty where they may."""
    if fit.verdict == "none":
        return (fit.reason,)
    low, high = fit.ci(level, "gain")
    if not low * high > 0.0:
        ends = f"{low:.3g} and {high:.3g}"
        return (f"the sign of the plant's gain is not certain, because its interval is {ends}",)
    if fit.verdict == "reliable" or allow_indication:
        return ()
    return (f"the estimate is only an indication: {fit.reason}",)


def wanted_gains(
    fit: PlantEstimate,
    template: Controller,
    *,
    sample_time: float | None,
    limit: float | None,
    level: float,
    flown: Controller | None,
    demands: Mapping[str, Any],
) -> Gains:
    """The best gains for all plants that an estimate leaves possible, one step from the flown."""
    loops = tuple(possible_loops(fit, template, level, sample_time, limit))
    where = {"ranges": _ranges(fit, template)} | dict(demands)
    found = design(loops[0], controller=template, plants=loops[1:], **where)
    chosen, remarks = _one_step(found.loop.controller, flown)
    if fit.verdict != "reliable":
        remarks = (
            f"The estimate is only an indication, but you allowed a design on it: {fit.reason}.",
            *remarks,
        )
    return Gains(found, chosen, loops, remarks)


def refusals(
    fit: PlantEstimate,
    gains: Gains,
    typed: Controller,
    flown: Controller | None,
    rounding: float,
    most: float | None,
) -> tuple[str, ...]:
    """Why typed gains do not pass the gate; empty where they do. `most` is the Ms demanded."""
    gate = check_gains(
        gains.loops[0],
        typed,
        flown=typed if flown is None else flown,
        loops=gains.loops[1:],
        max_sensitivity=max(LARGEST_SENSITIVITY, most or 0.0) * (1.0 + ROUNDED * rounding),
        largest_change=LARGEST_CHANGE * (1.0 + rounding),
        noise=fit.noise_std,
    )
    return gate.reasons


def _ranges(fit: PlantEstimate, template: Controller) -> dict[str, tuple[float, float]] | None:
    """Where gains of an integrating plant are looked for; None where that is known otherwise.

    By its largest proportional gain and the time in which half of that acts.
    """
    largest, time = abs(fit.largest_gain), 1.0 / fit.crossover
    if not (fit.best.integrates and "Ki" in template.gains and isfinite(largest * time)):
        return None
    sign = copysign(1.0, fit.parameters["gain"])
    units = {"Kp": largest, "Ki": largest / time, "Kd": largest * time}
    ends = {name: (sign * LEAST * units[name], sign * units[name]) for name in template.gains}
    return {name: (min(pair), max(pair)) for name, pair in ends.items()}


def _one_step(wanted: Controller, flown: Controller | None) -> tuple[Controller, tuple[str, ...]]:
    """Gains at most `LARGEST_CHANGE` times from those that were flown."""
    if flown is None:
        return wanted, ()
    gains = wanted.gains
    for name, gain in wanted.gains.items():
        if old := flown.gains.get(name, 0.0):
            if old * gain < 0.0:
                raise ValueError(
                    f"{name} = {old:g} was in use, but this plant needs {gain:.3g}, with the "
                    "other sign: check the signs of command and measurement"
                )
            low, high = sorted((old / LARGEST_CHANGE, old * LARGEST_CHANGE))
            gains[name] = min(max(gain, low), high)
    changed = [
        name for name, gain in wanted.gains.items() if abs(gains[name] - gain) > SAME * abs(gain)
    ]
    if not changed:
        return wanted, ()
    words = ", ".join(f"{name} = {wanted.gains[name]:.4g}" for name in changed)
    return replace(wanted, **gains), (
        f"The design has {words}. In one step, a gain changes by at most a factor of "
        f"{LARGEST_CHANGE:g}. Record again with the gains above, and then take the next step.",
    )
