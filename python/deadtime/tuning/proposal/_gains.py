"""Gains for all plants that an estimate leaves possible, and whether they may be used."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from deadtime.estimation import PlantEstimate
from deadtime.loops import Controller, ControlLoop
from deadtime.tuning._design import design
from deadtime.tuning._result import Design

#: Margins that are asked for where nothing is: those of a maximum sensitivity of 1.67 at most.
MARGINS = {"gain_margin": 2.5, "phase_margin": 50.0}

#: Largest factor by which a gain may change against the one that was flown, in one step. Larger: a
#: wrong estimate costs more; smaller: more steps to the same gains.
STEP = 2.0


@dataclass(frozen=True)
class Gains:
    """Gains for an estimate.

    Attributes
    ----------
    design : Design
        As it was found.
    loops : tuple of ControlLoop
        The loops that the estimate leaves possible, the likeliest first, with the gains.
    reasons : tuple of str
        Why the gains may not be used; empty where they may.
    remarks : tuple of str
        What was changed for them to be used.
    """

    design: Design
    loops: tuple[ControlLoop, ...]
    reasons: tuple[str, ...]
    remarks: tuple[str, ...] = ()


def gains_for(
    fit: PlantEstimate,
    template: Controller,
    *,
    sample_time: float | None,
    limit: float | None,
    level: float,
    allow_indication: bool,
    flown: Controller | None,
    demands: Mapping[str, Any],
) -> Gains:
    """Find gains over the intervals of an estimate, and say whether they may be used."""
    loop = fit.loop(template, sample_time=sample_time, limit=limit)
    late, strong = (fit.ci(level, name) for name in ("delay", "gain"))
    asked: dict[str, Any] = dict(demands) or MARGINS
    found = design(loop, controller=template, delay=late, gain=strong, **asked)
    remarks: tuple[str, ...] = ()
    best = found.loop.replace(delay=fit.delay, gain=fit.parameters["gain"])
    if flown is not None:
        best, remarks = _one_step(best, flown)
    corners = itertools.product(late, strong)
    loops = (best, *(best.replace(delay=each, gain=gain) for each, gain in corners))
    return Gains(found, loops, _reasons(fit, loops, allow_indication), remarks)


def _one_step(loop: ControlLoop, flown: Controller) -> tuple[ControlLoop, tuple[str, ...]]:
    """The loop with gains at most `STEP` times from those that were flown."""
    wanted, limited = loop.controller.gains, {}
    for name, gain in wanted.items():
        old = flown.gains.get(name, 0.0)
        low, high = sorted((old / STEP, old * STEP))
        limited[name] = min(max(gain, low), high) if old else gain
    changed = [name for name in wanted if limited[name] != wanted[name]]
    if not changed:
        return loop, ()
    words = ", ".join(f"{name} = {wanted[name]:.4g}" for name in changed)
    return loop.replace(**limited), (
        f"The design has {words}. A gain changes by at most a factor of {STEP:g} in one step: "
        "record again with these, and take the next step.",
    )


def _reasons(
    fit: PlantEstimate, loops: tuple[ControlLoop, ...], allow_indication: bool
) -> tuple[str, ...]:
    """Why the gains of these loops may not be used."""
    reasons = []
    if fit.verdict != "reliable" and not allow_indication:
        reasons.append(f"the estimate is an indication: {fit.reason}")
    if not all(loop.is_stable() for loop in loops):
        reasons.append("the loop is not stable for all plants that the recording leaves possible")
    return tuple(reasons)


def with_typed(gains: Gains, typed: Controller) -> Gains:
    """The same with the gains that are typed in, rounded as they are."""
    loops = tuple(loop.replace(controller=typed) for loop in gains.loops)
    return replace(gains, loops=loops)
