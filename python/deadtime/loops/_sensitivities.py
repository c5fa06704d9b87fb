"""Slopes of a response with respect to numbers of its loop.

The kernel runs in numbers that carry a slope, so breaking points, arrivals and samples move with
the parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from deadtime._base.arrays import Array
from deadtime.loops._runs import LoopRun
from deadtime.loops._specification import LoopSpecification, refuse_discretised

Slopes = dict[str, Array]

_STEP = 1e-30


def slope_names(loop: LoopSpecification, names: Sequence[str]) -> tuple[str, ...]:
    """Check the names of the numbers with respect to which slopes are asked for."""
    if isinstance(names, str):
        raise TypeError(f"sensitivities={names!r}: give a sequence of names, such as ({names!r},)")
    refuse_discretised(loop.controller, loop.sample_time, "sensitivities")
    known = loop.parameters
    for name in names:
        if name not in known:
            raise ValueError(
                f"sensitivities: this loop has no parameter {name!r}. Choose from "
                f"{', '.join(known)}"
            )
        if name.startswith("lag") and known[name] == 0.0:
            raise ValueError(
                f"sensitivities: at {name}=0 the order of the plant changes, so there is no "
                "derivative with respect to this lag. Give the plant a small lag, or take the "
                "derivative with respect to the delay, which has a similar effect"
            )
        if name == "delay" and known[name] == 0.0 and loop.sample_time is None:
            raise ValueError(
                "sensitivities: at delay=0 the derivative with respect to the delay cannot be "
                "computed for a continuous loop. Give the loop a small delay"
            )
    return tuple(dict.fromkeys(names))


def output_and_input_slopes(
    loop: LoopSpecification,
    names: Sequence[str],
    initial: tuple[float, float],
    since: Array,
    run: LoopRun,
) -> tuple[Slopes, Slopes]:
    """Slopes of outputs and inputs at times `since` the start, as are those of the run.

    `initial` holds output and reference before the start.
    """
    if not names:
        return {}, {}
    found = loop.kernel.sensitivities(
        list(names), run, initial, since + loop.output_lead, since, _given_slopes(loop, names)
    )
    return (
        dict(zip(names, found.outputs, strict=True)),
        dict(zip(names, found.inputs, strict=True)),
    )


def _given_slopes(loop: LoopSpecification, names: Sequence[str]) -> list[Any] | None:
    """Value and slope of the polynomials of a plant that gives them, for each of the numbers.

    The slopes are those by the complex step (Squire & Trapp 1998), in units of the number.
    """
    values: dict[str, Any] = dict(loop.parameters)
    if loop.plant._given(values) is None:
        return None
    found = []
    for name in names:
        unit = abs(values[name]) or 1.0
        given = loop.plant._given(values | {name: complex(values[name], _STEP * unit)})
        parts = [] if given is None else given
        found.append(
            tuple([(float(np.real(c)), float(np.imag(c)) / _STEP) for c in part] for part in parts)
        )
    return found
