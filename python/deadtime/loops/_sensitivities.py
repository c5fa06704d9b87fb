"""Slopes of a response with respect to numbers of its loop.

The stepper runs in numbers that carry a slope, so breaking points, arrivals and samples move with
the parameter. What it needs are the slopes of the loop's matrices and of its start: the equations
are evaluated at value + 1e-30 i, whose imaginary part is the slope to rounding (complex step;
Squire & Trapp 1998).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime.loops._model import LoopRun, refuse_discretised, state_at_rest
from deadtime.loops._native import loop_sensitivities
from deadtime.loops._specification import LoopSpecification

Slopes = dict[str, Array]

_STEP = 1e-30


class LoopSlopes(NamedTuple):
    """A loop as the stepper takes it, and derivatives by parameters, a row a parameter.

    They are derivatives of the row, of the state and the command before the start, and of how much
    earlier than its measurement the output is.
    """

    row: Array
    row_slopes: Array
    state_slopes: Array
    command_slopes: Array
    output_lead_slopes: Array


def slope_names(loop: LoopSpecification, names: Sequence[str]) -> tuple[str, ...]:
    """Check the names of the numbers with respect to which slopes are asked for."""
    if isinstance(names, str):
        raise TypeError(f"sensitivities={names!r}: give a sequence of names, such as ({names!r},)")
    refuse_discretised(loop.controller, loop.sample_time, "sensitivities")
    known = loop.parameters
    for name in names:
        if name not in known:
            raise ValueError(
                f"sensitivities: this loop has no number {name!r}; choose from {', '.join(known)}"
            )
        if name.startswith("lag") and known[name] == 0.0:
            raise ValueError(
                f"sensitivities: at {name}=0 the plant changes its order and has no slope with "
                "respect to the lag; give the plant a small lag, or take the slope with respect "
                "to the delay, which acts like it"
            )
        if name == "delay" and known[name] == 0.0 and loop.sample_time is None:
            raise ValueError(
                "sensitivities: at delay=0 a continuous loop has no slope with respect to the "
                "delay that could be computed without one; give it a small delay"
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
    values: dict[str, Any] = dict(loop.parameters)
    # In units of their own size, all slopes are comparable with the values.
    units = {name: abs(values[name]) or 1.0 for name in names}
    rows, states, commands, leads = [], [], [], []
    for name in names:
        stepped = values | {name: complex(values[name], _STEP * units[name])}
        rows.append(_row(loop, stepped).imag / _STEP)
        begin, held = state_at_rest(loop.plant, loop.controller, stepped, *initial)
        states.append(np.imag(begin) / _STEP)
        commands.append(np.imag(held) / _STEP)
        moves = name == "delay" and loop.delay_path == "measurement"
        leads.append(units[name] if moves else 0.0)
    slopes = LoopSlopes(
        row=_row(loop, values),
        row_slopes=np.array(rows),
        state_slopes=np.array(states),
        command_slopes=np.array(commands),
        output_lead_slopes=np.array(leads),
    )
    found = loop_sensitivities(slopes, run, since + loop.output_lead, since)
    return (
        {name: row / units[name] for name, row in zip(names, found.outputs, strict=True)},
        {name: row / units[name] for name, row in zip(names, found.inputs, strict=True)},
    )


def _row(loop: LoopSpecification, values: dict[str, Any]) -> NDArray[Any]:
    model = loop.model_at(values)
    return model.row(values["delay"], values.get("sample_time"), values.get("limit"))
